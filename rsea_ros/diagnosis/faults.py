"""Faults of the data, found before any physics, reported and masked. One function a kind.

Each takes a channel and returns which samples are bad, shape (n,). A sample that is masked is never fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.diagnosis.clock import repair_clock
from rsea_ros.identification.quantum import step_of
from rsea_ros.model.rig import Rig
from rsea_ros.signals import BoolArray, Channel, Fault, FloatArray, Record

_AROUND = 10
_SPIKE = 12.0
"""A sample further than this many spreads of the ten around it from their median is an outlier."""
_CLIPPED = 8
"""As many samples at exactly the largest value, some of them in a row, are clipping."""
_SMALLEST_SHARE = 1e-3
_SLOW = 0.25
_COARSE = 5.0
"""Steps of so many times what the rig's sensor makes are told."""


@dataclass(frozen=True)
class Checked:
    """A record with its faults: finite, rising stamps; and which samples must not count, by channel."""

    record: Record
    masked: Mapping[str, BoolArray]
    faults: tuple[Fault, ...]


def check(record: Record, rig: Rig) -> Checked:
    """Find and mask the faults of a record; a sensor without a good sample is taken as not there."""
    faults = [*record.faults, *(Fault("missing_topic", name, 1.0) for name in missing(record, rig))]
    repaired, clock_faults = repair_clock(record)
    faults += clock_faults
    masked: dict[str, BoolArray] = {}
    for name, channel in repaired.channels.items():
        bad = np.zeros(len(channel), bool)
        for kind, find in FINDERS.items():
            found = find(channel, name) & ~bad
            if kind == "frozen_samples":
                found = while_others_moved(repaired, name, found)
            if found.mean() > (_SMALLEST_SHARE if kind == "frozen_samples" else 0.0):
                faults.append(Fault(kind, name, float(found.mean())))
                bad |= found
        masked[name] = bad
    faults += [fault for n in repaired.channels if n in rig.sensors for fault in coarse(repaired[n], n, rig)]
    dead = {n for n, bad in masked.items() if bad.all() and n != "command"}
    alive = replace(repaired, channels={n: c for n, c in repaired.channels.items() if n not in dead})
    return Checked(_filled(alive, masked), masked, tuple(faults))


def missing(record: Record, rig: Rig) -> tuple[str, ...]:
    """Return the channels that the rig's sensors would give and the record has not."""
    return tuple(n for n in rig.sensors if n not in record)


def coarse(channel: Channel, name: str, rig: Rig) -> list[Fault]:
    """Return the fault of a sensor whose values come in much larger steps than the rig's sensor makes.

    Nothing is masked: such a sensor is noisy, not wrong.
    """
    step, sensor = step_of(channel.y), rig.sensors[name]
    stated = max(sensor.quantum, sensor.noise)
    if step == 0.0 or step < _COARSE * stated:
        return []
    return [Fault("coarse_steps", name, 1.0, f"steps of {step:.3g} where the rig's sensor has {stated:.3g}")]


def not_finite(channel: Channel, name: str) -> BoolArray:
    """Return which values are NaN or infinite."""
    return ~np.isfinite(channel.y)


def outliers(channel: Channel, name: str) -> BoolArray:
    """Return which samples stand alone: far from the median of the ten around them, which agree.

    How far those ten lie from it is told by the third largest, so that two outliers may be neighbours.
    """
    if name == "command" or len(channel) < 2 * _AROUND or not np.isfinite(channel.y).any():
        return np.zeros(len(channel), bool)
    padded = np.pad(
        np.nan_to_num(channel.y, nan=float(np.nanmedian(channel.y))), _AROUND // 2, mode="reflect"
    )
    around = np.delete(np.lib.stride_tricks.sliding_window_view(padded, _AROUND + 1), _AROUND // 2, axis=1)
    middle = np.median(around, axis=1)
    spread = np.partition(np.abs(around - middle[:, None]), _AROUND - 3, axis=1)[:, _AROUND - 3]
    steps = np.abs(np.diff(channel.y))
    least = float(np.nanmedian(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    found: BoolArray = np.abs(channel.y - middle) > _SPIKE * np.maximum(spread, least)
    return found


def clipping(channel: Channel, name: str) -> BoolArray:
    """Return which samples lie at exactly the largest or smallest value, where many do in a row."""
    bad = np.zeros(len(channel), bool)
    if name in ("command", "reference", "motor_torque") or not np.isfinite(channel.y).any():
        return bad
    for extreme in (np.nanmax(channel.y), np.nanmin(channel.y)):
        at = channel.y == extreme
        in_a_row = at[1:] & at[:-1]
        if (
            at.sum() >= _CLIPPED
            and in_a_row.sum() >= _CLIPPED // 2
            and not _common(channel.y, float(extreme))
        ):
            bad |= at
    return bad


def _common(y: FloatArray, extreme: float) -> bool:
    """Tell whether values just inside the extreme are as common as the extreme itself (a coarse quantum)."""
    values, counts = np.unique(y[np.isfinite(y)], return_counts=True)
    k = int(np.argmin(np.abs(values - extreme)))
    inside = (
        counts[max(k - 3, 0) : k].max(initial=0)
        if k > len(values) // 2
        else counts[k + 1 : k + 4].max(initial=0)
    )
    return bool(counts[k] < 4 * max(int(inside), 1))


def frozen(channel: Channel, name: str) -> BoolArray:
    """Return which samples repeat the one before more often than a quantum explains.

    With a quantum, neighbouring values may be equal by chance; as many differ by one quantum then, give or
    take three standard deviations. A sensor that repeats every other sample or more is slower than the log,
    which is no fault.
    """
    if name in ("command", "reference"):
        return np.zeros(len(channel), bool)
    step = np.diff(channel.y, prepend=np.nan)
    repeat: BoolArray = step == 0.0
    moving = np.abs(step[np.isfinite(step) & ~repeat])
    if not len(moving):
        return repeat
    by_chance = float((moving < 1.5 * float(moving.min())).sum()) / 2.0
    surplus = float(repeat.sum()) - 1.5 * by_chance - 3.0 * float(np.sqrt(repeat.sum()))
    is_fault = max(5.0, _SMALLEST_SHARE * len(channel)) < surplus < _SLOW * len(channel)
    return repeat if is_fault else np.zeros(len(channel), bool)


def while_others_moved(record: Record, name: str, repeat: BoolArray) -> BoolArray:
    """Return the repeats while another sensor moved: a sensor that stands still with the machine is well.

    Half of all samples move by more than the median; where a machine sticks few do.
    """
    witness = next((n for n in _WITNESSES.get(name, ()) if n in record and len(record[n]) > 1), None)
    if witness is None or not repeat.any():
        return repeat
    t = record[name].t
    seen = np.abs(np.diff(np.interp(t, record[witness].t, np.nan_to_num(record[witness].y)), prepend=np.nan))
    moved = repeat & (seen > np.nanmedian(seen))
    return repeat if moved.sum() > _MOVED * repeat.sum() else np.zeros(len(t), bool)


_WITNESSES = {
    "position": ("ft", "velocity"),
    "ft": ("position", "velocity"),
    "velocity": ("ft", "position"),
    "motor_torque": ("command",),
}
_MOVED = 0.3
"""Share of the repeats that fall into motion when a sensor freezes at any time; by chance 0.5."""

FINDERS: Mapping[str, Callable[[Channel, str], BoolArray]] = {
    "nan": not_finite,
    "clipping": clipping,
    "frozen_samples": frozen,
    "outliers": outliers,
}


def _filled(record: Record, masked: Mapping[str, BoolArray]) -> Record:
    """Return the record with bad values bridged by straight lines, so that a simulation can run."""
    channels = {}
    for name, channel in record.channels.items():
        good = ~masked[name] & np.isfinite(channel.y)
        bridged = (
            np.interp(channel.t, channel.t[good], channel.y[good]) if good.any() else np.zeros(len(channel))
        )
        channels[name] = Channel(channel.t, np.where(good, channel.y, bridged))
    return record.with_channels(**channels)
