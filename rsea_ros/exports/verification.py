"""Exports played against the own simulation."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.exports.mujoco_play import CHANNELS, RATE, Difference, differences, losses, ours, play_mujoco
from rsea_ros.exports.others import Export
from rsea_ros.model.rig import Rig
from rsea_ros.outputs.files import write_new
from rsea_ros.records.record import FloatArray


def play_fmu(archive: bytes, rig: Rig, command: FloatArray) -> dict[str, FloatArray]:
    """Return the measurements of the exported rig at the beginning of each command's hold.

    command: N m, or target rad of a rig with a position loop, at RATE. Raises ParameterError without FMPy.
    """
    try:
        from fmpy import simulate_fmu
        from fmpy.fmi1 import FMICallException
    except ImportError:
        raise ParameterError(
            "playing the FMU needs the package fmpy, which is not installed: pip install fmpy, or --no-play"
        ) from None
    driven = "torque_command" if rig.loop is None else "desired_position"
    t = np.arange(len(command)) / RATE
    given = np.array(list(zip(t, command, strict=True)), dtype=[("time", "f8"), (driven, "f8")])
    names = [name for name in CHANNELS if rig.measures(name)]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rig.fmu"
        write_new(file, archive)
        try:
            result = simulate_fmu(
                str(file), stop_time=float(t[-1]), step_size=1.0 / RATE, output_interval=1.0 / RATE,
                input=given, output=names, validate=True, start_values={"duration": len(t) / RATE},
            )  # fmt: skip
        except FMICallException as error:
            raise ParameterError(f"FMPy: {' '.join(str(error).split())}") from None
    return {name: np.asarray(result[name], np.float64) for name in names}


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
