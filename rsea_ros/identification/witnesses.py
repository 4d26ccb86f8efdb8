"""Signals with which a misfit would be coherent, but sensor noise is not.

The command; laws of friction, play, springs, ripple and drift over the simulated motion; and the
residual of another sensor: two sensors that see the same misfit agree about it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive
from rsea_ros.records.record import FloatArray

_SHARP = 0.05
"""Of a signal's RMS: the width of its sign's step."""
_ONE_SENSOR = frozenset({"position", "velocity"})
"""Channels that one encoder makes: their noise agrees."""


def witnesses(
    case: Case, outputs: Mapping[str, FloatArray], channel: str, ratio: float
) -> Iterator[FloatArray]:
    """Yield signals at the stamps of a channel. outputs: simulated. ratio: of the gear, rotor over output."""
    t = case.t[channel]
    for n in case.measured.keys() & outputs.keys():
        if n != channel and {n, channel} != _ONE_SENSOR:
            residual = np.where(case.mask[n], case.measured[n] - outputs[n], 0.0)
            yield np.interp(t, case.t[n], residual)
    command, q, v, load = _motion(case, outputs, t)
    late = (t - t.mean()) / max(float(np.ptp(t)), 1e-9)
    yield command
    yield command**3
    for x in (q, v, load):
        yield from (_sign(x), x * np.abs(x), x * late)
    yield from (q**2, q**3, np.abs(v), np.abs(load) * _sign(v))
    yield from (np.sin(ratio * q), np.cos(ratio * q))


def _sign(x: FloatArray) -> FloatArray:
    return np.tanh(x / max(_SHARP * float(np.std(x)), 1e-300))


def _motion(case: Case, outputs: Mapping[str, FloatArray], t: FloatArray) -> tuple[FloatArray, ...]:
    """Return command, position, velocity and load at instants; those without a sensor are derived."""
    drive = case.drive
    if not isinstance(drive, Drive):
        return tuple(np.interp(t, drive.t, y) for y in (drive.torque, drive.q, drive.v, drive.torque))
    steps = ((t - drive.start) / drive.step).astype(np.int64)
    command = drive.command[np.clip(steps, 0, len(drive.command) - 1)]
    at = {n: np.interp(t, case.t[n], outputs[n]) for n in case.t.keys() & outputs.keys()}
    load = at.get("ft", command)
    q = at.get("position", load)
    v = at["velocity"] if "velocity" in at else np.gradient(q, t)
    return command, q, v, load
