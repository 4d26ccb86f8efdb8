"""Causes that share a name until more torque is allowed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.experiment.hypothesis import Hypothesis, may_contain
from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.separation import shapes_for, trial_of
from rsea_ros.experiment.shape_rater import ShapeRater, noise_by_channel
from rsea_ros.identification.solver import Map, serial

_FURTHEST = 6
"""Doublings of the torque limit up to which one is sought."""


def torque_that_shows(
    hypotheses: Sequence[Hypothesis],
    asked: DesignRequest,
    measured: Mapping[str, float],
    run: Map = serial,
) -> float | None:
    """Return about the least torque limit (N m) at which a test shows the causes after the first.

    The test is the longest run, and the other limits stay as they are. None where even 2^_FURTHEST times the
    limit is not enough, as where another limit holds the torque back. measured: noise by channel.
    """
    apart = np.eye(len(hypotheses), dtype=bool)
    for k in range(1, _FURTHEST + 1):
        torque = 2.0**k * asked.limits.torque
        wider = replace(asked, limits=replace(asked.limits, torque=torque))
        rater = ShapeRater(hypotheses, wider, noise_by_channel(hypotheses, measured), run)
        if any(trial_of(rater, s, asked.longest, apart).share >= asked.test for s in shapes_for(asked)):
            return torque
    return None


@dataclass(frozen=True)
class SharedName:
    """A cause and those that contain it, which no run within the limits would rather show than not.

    names: the likeliest first. torque: N m, about the least limit with which a run would, None: none would.
    """

    names: tuple[str, ...]
    torque: float | None


def shared_name(
    causes: Sequence[Hypothesis], asked: DesignRequest, measured: Mapping[str, float], run: Map = serial
) -> SharedName | None:
    """Return the name that causes share, None where they do not all contain one of them.

    causes: the likeliest first. asked: of the test that would decide. measured: noise by channel.
    """
    simple = _contained(causes)
    if simple is None:
        return None
    richer = [h.beside(simple.name) for h in causes if h is not simple]
    torque = torque_that_shows([simple, *richer], asked, measured, run)
    return SharedName(tuple(h.name for h in causes), torque)


def _contained(causes: Sequence[Hypothesis]) -> Hypothesis | None:
    """Return the cause that every other of them may contain, None without such or without others."""
    for cause in causes if len(causes) > 1 else ():
        if all(may_contain(other.name, cause.name) for other in causes if other is not cause):
            return cause
    return None
