"""Dead channels: constant, or noise that has nothing to do with what the machine did."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from rsea_ros.checks.expected import Side, quotients
from rsea_ros.checks.moved_spans import is_commanded
from rsea_ros.checks.slow_lag import lag_behind
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import MEASURED, Channel, Fault, Record

_VISIBLE = 3.0
"""Times the sensor's noise: a smaller signal than that may well be lost in it."""
_CONFIRMED = 0.5
"""Correlation of a speed with the rate of the position, far above what noise has by chance, either sign."""
_SHOWS = 0.3
"""Of the channel's RMS: a predicted signal so large would show in it, whatever else is in the channel."""


def dead_channels(
    record: Record, compared: Mapping[str, Side], rig: Rig, frozen: Collection[str] = ()
) -> list[Fault]:
    """Return a fault for every sensor that does not measure. record: finite values, rising stamps.

    compared: the record beside the rig's simulation.
    frozen: channels of which a part is held, which says why they have little to do with the command.
    Where the signal that the rig's simulation predicts is below the noise, no sensor is
    called dead.
    """
    if not is_commanded(record):
        return []
    constant = {n: _constant(record[n], n, compared.get(n), rig) for n in record.channels if n in MEASURED}
    # A torque also has friction that no motion shows.
    responses = {} if is_inverse(rig) else quotients(compared)
    for n, q in responses.items():
        shows = q.predicted > max(_SHOWS * q.measured, _VISIBLE * _noise(rig, n))
        alone = shows and q.is_unrelated and not lag_behind(record, rig, n, compared[n])
        if n in constant and not constant[n] and n not in frozen and alone and not _is_confirmed(record, n):
            constant[n] = "noise that has nothing to do with the command"
    return [Fault("dead_channel", n, 1.0, detail) for n, detail in constant.items() if detail]


def _constant(channel: Channel, name: str, side: Side | None, rig: Rig) -> str:
    """Return the fault of a channel that holds one value although its signal must have changed."""
    if len(channel) < 2 or float(np.ptp(channel.y)) > 0.0:
        return ""
    if side is not None and float(np.std(side.p)) < _VISIBLE * _noise(rig, name):
        return ""
    return f"constant at {channel.y[0]:.4g}"


def _is_confirmed(record: Record, name: str) -> bool:
    """Return whether position and velocity agree: one is the rate of the other, whatever the rig says."""
    if name not in ("position", "velocity") or not {"position", "velocity"} <= record.channels.keys():
        return False
    position, velocity = record["position"], record["velocity"]
    rate = np.interp(velocity.t, position.t, np.gradient(position.y, position.t))
    if not (np.std(rate) > 0.0 and np.std(velocity.y) > 0.0):
        return False
    return bool(abs(np.corrcoef(rate, velocity.y)[0, 1]) > _CONFIRMED)


def _noise(rig: Rig, name: str) -> float:
    sensor = rig.sensors.get(name)
    return max(sensor.noise, sensor.quantum) if sensor else 0.0
