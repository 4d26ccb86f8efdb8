"""The torque limit at which a run would show a cause that no run within the limits shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.experiment.hypothesis import Hypothesis
from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.shape_rater import ShapeRater, noise_by_channel
from rsea_ros.experiment.trials import shapes_for, trial_of
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
