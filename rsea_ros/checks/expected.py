"""What the rig expects of each channel, how late it comes, and the spans in which the machine moved.

A channel is late by the lag L within +-2 s at which its samples y(t_i) agree best with the prediction
p(t_i - L), by their correlation. It counts only where no other lag does nearly as well: a periodic command
has many. For a channel slower than the commands the rig is simulated at the stamps of the commands.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.fft import irfft, rfft

from rsea_ros.checks.finding import Finding
from rsea_ros.checks.response_shape import Quotient, quotient
from rsea_ros.errors import RseaError
from rsea_ros.model.extent import is_too_fast
from rsea_ros.model.inverse import inverse_torque, is_inverse, motion_from
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import BoolArray, Channel, FloatArray, Record
from rsea_ros.records.statistics import next_fast_length

MOST_STEPS = 40.0
"""Times as many periods as samples in the command: a record of gaps, which no simulation should fill."""


@dataclass(frozen=True)
class Side:
    """One channel at its stamps t (s): measured y and predicted p, both shape (n,), in the channel's unit."""

    t: FloatArray
    y: FloatArray
    p: FloatArray


def sides(record: Record, rig: Rig) -> Mapping[str, Side]:
    """Return measured beside predicted by channel; empty where nothing can be simulated.

    record: with finite values and rising stamps. A rig without a spring has one side, the torque that the
    measured motion takes (model/inverse.py).
    """
    if "command" not in record or len(record["command"]) < 64:
        return {}
    if is_full_of_gaps(record) or is_too_fast(record):
        return {}
    try:
        with np.errstate(all="ignore"):
            return _inverse(record, rig) if is_inverse(rig) else _forward(record, rig)
    except (RseaError, ValueError, np.linalg.LinAlgError):
        return {}


def _forward(record: Record, rig: Rig) -> Mapping[str, Side]:
    predicted = {n: p for n, p in simulate(rig, record).items() if np.isfinite(p).all()}
    return {n: Side(record[n].t, record[n].y, p) for n, p in predicted.items()}


def _inverse(record: Record, rig: Rig) -> Mapping[str, Side]:
    if "position" not in record:
        return {}
    motion = motion_from(record)
    known = motion.counts if motion.counts.any() else np.ones(len(motion.t), bool)
    return {"motor_torque": Side(motion.t[known], motion.torque[known], inverse_torque(rig, motion)[known])}


def is_full_of_gaps(record: Record) -> bool:
    """Return whether the record lasts much longer than its samples do: a clock that was set."""
    t = record["command"].t
    period = float(np.median(np.diff(t)))
    return not period > 0.0 or record.stop - record.start > MOST_STEPS * period * len(t)


def quotients(compared: Mapping[str, Side]) -> dict[str, Quotient]:
    """Return the quotient of every channel that has one."""
    by_channel = {n: quotient(n, s.t, s.y, s.p) for n, s in compared.items()}
    return {n: q for n, q in by_channel.items() if q is not None}


WITNESSES = {
    "position": ("ft", "velocity", "motor_torque", "command"),
    "ft": ("position", "deflection", "velocity", "motor_torque", "command"),
    "deflection": ("ft", "position", "velocity", "motor_torque", "command"),
    "velocity": ("ft", "position", "motor_torque", "command"),
    "motor_torque": ("command",),
}
"""By sensor: who can say whether it had something to measure, the best first."""
_AROUND = 9
"""Samples over which a witness must have changed."""
_CLEARLY = 4.0
"""Times what the witness changes by where it is quietest: more is motion."""


class MotionBeside(NamedTuple):
    """Of another channel at a channel's samples: whether it moved, and by how much a sample, shape (n,)."""

    moved: BoolArray
    speed: FloatArray


def witness_of(record: Record, name: str, but: Collection[str] = ()) -> str | None:
    """Return the channel that shows best whether another had something to measure, None for none.

    but: channels that cannot be trusted.
    """
    able = (n for n in WITNESSES.get(name, ()) if n in record and n not in but and _is_witness(record[n]))
    return next(able, None)


def motion_beside(record: Record, name: str, witness: str | None) -> MotionBeside | None:
    """Return how a witness moved at the samples of a channel, None without a witness."""
    if witness is None:
        return None
    t, channel = record[name].t, record[witness]
    moved = np.interp(t, channel.t, moves(channel).astype(float)) >= 0.5
    speed = np.abs(np.diff(np.interp(t, channel.t, np.nan_to_num(channel.y)), prepend=np.nan))
    return MotionBeside(moved, np.nan_to_num(speed))


def is_commanded(record: Record) -> bool:
    """Return whether the command of a record changes, if there is one."""
    return "command" not in record or float(np.ptp(np.nan_to_num(record["command"].y))) > 0.0


def is_still(record: Record) -> bool:
    """Return whether every sensor shows only white noise, by its fourth differences."""
    return all(_is_noise(record[n]) for n in ("position", "velocity", "ft", "deflection") if n in record)


def _is_noise(channel: Channel) -> bool:
    y = channel.y[np.isfinite(channel.y)]
    if len(y) < 64:
        return False
    y = y / max(float(np.abs(y).max()), np.finfo(float).tiny)  # the squares of 1e300 are infinite
    white = float(np.std(np.diff(y, 4))) / math.sqrt(70.0)
    return float(np.std(y)) <= 1.5 * white


def at_rest(record: Record) -> float:
    """Return the share of the commands at which neither command nor machine moved."""
    t = record["command"].t
    still = ~moves(record["command"])
    for name in ("position", "velocity", "ft", "deflection"):
        if name in record and _is_witness(record[name]):
            moved = moves(record[name])
            still &= ~moved[np.clip(np.searchsorted(record[name].t, t), 0, len(moved) - 1)]
            break
    return float(still.mean())


def _is_witness(channel: Channel) -> bool:
    y = channel.y[np.isfinite(channel.y)]
    return len(y) > 2 * _AROUND and float(np.ptp(y)) > 0.0


def moves(channel: Channel) -> BoolArray:
    """Return at which samples a channel changes by more than its own noise, shape (n,)."""
    y = np.nan_to_num(channel.y, nan=float(np.nanmedian(channel.y)))
    if len(y) <= _AROUND:
        return np.zeros(len(y), bool)
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(y, _AROUND // 2, mode="edge"), _AROUND)
    change = np.ptp(windows, axis=1)
    quiet = float(np.quantile(change, 0.02))
    largest = float(np.quantile(change, 0.99))
    clearly: BoolArray = change > max(min(_CLEARLY * quiet, 0.5 * largest), 1e-3 * largest)
    return clearly


REACH = 2.0
"""s, either way."""
NEAR = 0.05
"""s. Smaller lags are found by their phases (response_shape.py, linearised_rig.py), and another rig's
response looks so."""
_FEWEST = 64
"""Samples: fewer agree by chance somewhere."""
_PEAK = 0.5
"""Correlation that the best lag must reach."""
_BESIDE = 0.7
"""Of the best correlation: what other lags reach, none included, must be less."""
_AROUND_PEAK = 0.1
"""s about the best lag that belongs to its peak."""
_TOGETHER = 0.02
"""s. Channels whose lags lie so close share one."""
_SHORTEST = 4.0
"""Times the reach, down to which a record lasts long enough for all of it."""


def far_off(lags: Mapping[str, float | None]) -> dict[str, float]:
    """Return the lags (s) of channels that clearly come later (positive) or earlier than predicted."""
    return {n: lag for n, lag in lags.items() if lag is not None and abs(lag) > NEAR}


def lag_of(side: Side) -> float:
    """Return how much later than predicted a channel comes, s; 0 where no single lag stands out."""
    if len(side.t) < _FEWEST:
        return 0.0
    period = float(np.median(np.diff(side.t)))
    even = np.arange(side.t[0], side.t[-1], period)
    reach = min(REACH, period * len(even) / _SHORTEST)
    if len(even) < _FEWEST or reach < period:
        return 0.0
    y, p = (np.interp(even, side.t, v) for v in (side.y, side.p))
    return clear_lag(*_correlation(y, p, period, reach)) or 0.0


def clear_lag(lag: FloatArray, alike: FloatArray) -> float | None:
    """Return the lag (s) of the best correlation, 0 for a near one, None where it does not stand out.

    lag: s, shape (n,). alike: correlations from 0 to 1, shape (n,).
    """
    best = int(np.argmax(alike))
    aside = alike[np.abs(lag - lag[best]) > _AROUND_PEAK]
    if alike[best] < _PEAK or len(aside) == 0:
        return None
    if abs(lag[best]) <= NEAR:
        return 0.0
    return None if aside.max() > _BESIDE * alike[best] else float(lag[best])


def _correlation(y: FloatArray, p: FloatArray, period: float, reach: float) -> tuple[FloatArray, FloatArray]:
    """Return lags (s) within the reach, and the size of the correlation of y with p earlier by each."""
    y, p = y - y.mean(), p - p.mean()
    most = int(reach / period)
    size = next_fast_length(len(y) + most)
    both = irfft(rfft(y, size) * rfft(p, size).conj(), size)
    alike = np.abs(np.concatenate([both[-most:], both[: most + 1]]))
    scale = float(np.linalg.norm(y) * np.linalg.norm(p))
    lag = period * np.arange(-most, most + 1, dtype=np.float64)
    return lag, np.asarray(alike / max(scale, 1e-300))


def lag_findings(lags: Mapping[str, float], channels: int) -> list[Finding]:
    """Return a finding for each lag, one for the command where all channels share it."""
    all_of_them = shared_lag(lags, channels)
    off = {"command": -all_of_them} if all_of_them else lags
    against = "all that was measured" if all_of_them else "the command"
    return [
        Finding(
            "red", "clock_offset", name, late, "s", expected="0",
            detail=f"stamped {abs(late):.3g} s {'late' if late > 0.0 else 'early'} against {against}",
            remedy=f"stamp all by one clock, or move these stamps with --shift {name}={-late:.4g}",
        )
        for name, late in off.items()
    ]


def shared_lag(lags: Mapping[str, float], channels: int) -> float:
    """Return the lag (s) that all channels share, an error of the command's stamps; 0 for none.

    The motor torque, where it is measured, repeats the command and shows the lag best.
    """
    values = list(lags.values())
    together = len(values) == channels and len(values) > 0 and max(values) - min(values) <= _TOGETHER
    return lags.get("motor_torque", float(np.median(values))) if together else 0.0


def in_step(record: Record, lags: Mapping[str, float]) -> Record:
    """Return the record with the stamps of some channels earlier by their lags (s), within the commands."""
    moved = {n: Channel(record[n].t - lag, record[n].y) for n, lag in lags.items()}
    record = record.with_channels(**moved)
    begin = max(c.t[0] for c in record.channels.values() if len(c))
    end = min(c.t[-1] for c in record.channels.values() if len(c))
    return replace(record.between(float(begin), float(end)), faults=record.faults)


_SLOW = 0.6
"""Of the commands' rate: a faster channel is compared at its periods."""
_FEWEST_SLOW, _MOST_SLOW = 16, 400
"""Samples: fewer agree by chance somewhere; more cost time and say the same."""
_MOST_LAGS = 4000


def lag_behind(record: Record, rig: Rig, name: str, side: Side) -> float | None:
    """Return the lag of a channel, s, 0 where none shows; None for a slow one that no single lag fits."""
    if not _is_slow(record, rig, name):
        return lag_of(side)
    t = record["command"].t
    dense = sides(record.with_channels(**{name: Channel(t, np.zeros(len(t)))}), rig).get(name)
    lag = _lag(record[name], dense.t, dense.p) if dense is not None else None
    return lag if lag is not None else lag_of(side) or None


def _is_slow(record: Record, rig: Rig, name: str) -> bool:
    """Return whether the samples of a channel are further apart than the lags that are looked for."""
    if is_inverse(rig) or rig.loop is not None:
        return False
    return record[name].rate <= min(1.0 / NEAR, _SLOW * record["command"].rate)


def _lag(channel: Channel, t: FloatArray, p: FloatArray) -> float | None:
    """Return the lag of samples behind the values p at stamps t (s)."""
    reach = min(REACH, 0.25 * float(np.ptp(t)))
    at = (channel.t >= t[0] + reach) & (channel.t <= t[-1] - reach)
    kept = np.flatnonzero(at)
    kept = kept[np.linspace(0, len(kept) - 1, min(len(kept), _MOST_SLOW)).astype(np.int64)]
    y, stamps = channel.y[kept], channel.t[kept]
    if len(y) < _FEWEST_SLOW or not np.ptp(y) > 0.0:
        return None
    step = max(float(np.median(np.diff(t))), 2.0 * reach / _MOST_LAGS)
    lag = step * np.arange(-int(reach / step), int(reach / step) + 1)
    shifted = np.interp(stamps[None, :] - lag[:, None], t, p)
    shifted = shifted - shifted.mean(axis=1, keepdims=True)
    y = y - y.mean()
    size = np.linalg.norm(shifted, axis=1) * np.linalg.norm(y)
    alike: FloatArray = np.abs(shifted @ y) / np.maximum(size, 1e-300)
    return clear_lag(np.asarray(lag, np.float64), alike)


def open_findings(lags: Mapping[str, float | None], record: Record) -> list[Finding]:
    """Return a finding for each slow channel whose clock these data leave open."""
    return [
        Finding(
            "green", "clock_offset", n,
            detail=f"not determined: {len(record[n])} samples at {record[n].rate:.3g} Hz do not show it",
            remedy="record it faster",
        )
        for n, lag in lags.items()
        if lag is None
    ]
