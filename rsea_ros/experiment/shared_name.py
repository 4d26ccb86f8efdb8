"""The name that a cause shares with those that contain it, where no run within the limits would decide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rsea_ros.experiment.containment import may_contain
from rsea_ros.experiment.hypothesis import Hypothesis
from rsea_ros.experiment.needed_torque import torque_that_shows
from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.identification.solver import Map, serial


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
