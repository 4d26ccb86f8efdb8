"""An export against this project's simulation: played by the target, and what its omissions cost."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.exports.difference import RATE, Difference, differences, losses, ours
from rsea_ros.exports.fmu_play import play_fmu
from rsea_ros.exports.mujoco_play import play_mujoco
from rsea_ros.exports.represented import Export
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

PLAYERS: Mapping[str, Callable[..., Any]] = MappingProxyType({"mjcf": play_mujoco, "fmu": play_fmu})
NO_NOISE = "the rig states no sensor noise, expected sensors.ft.noise or another"


@dataclass(frozen=True)
class Verification:
    """differences: of the target's play from ours, by channel; not_played: why there are none.

    losses: of each omitted effect, in the channel that it changes most.
    """

    differences: tuple[Difference, ...] = ()
    losses: Mapping[str, Difference] = field(default_factory=dict)
    not_played: str = ""


def verify(made: Export, rig: Rig, command: FloatArray) -> Verification:
    """Play a command in our simulation, without each omitted effect, and in the target where it runs here.

    command: N m, or target rad of a rig with a position loop, at RATE.
    """
    names = [one.name for one in made.omitted]
    if made.target not in PLAYERS:
        why = "only --mjcf and --fmu are verified by simulation"
        return Verification((), _losses(rig, names, command), why)
    try:
        theirs = PLAYERS[made.target](made.content, rig, command)
        mine = ours(rig, command, RATE)
    except ParameterError as error:
        return Verification((), _losses(rig, names, command), str(error))
    apart = differences(rig, mine, theirs)
    return Verification(apart, losses(rig, names, mine, command, RATE), "" if apart else NO_NOISE)


def _losses(rig: Rig, names: list[str], command: FloatArray) -> Mapping[str, Difference]:
    """Return the losses of an export that is not played; none of a rig that cannot be simulated."""
    if not set(names) & {effect.name for effect in rig.effects}:
        return {}
    try:
        return losses(rig, names, ours(rig, command, RATE), command, RATE)
    except RseaError:
        return {}

