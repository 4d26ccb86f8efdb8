"""What the rig expects of each channel, the spans in which the machine moved, and responses by frequency.

The response of one signal to another, over half-overlapping Hann segments k:

    R = sum_k Y_k X_k* / sum_k |X_k|^2

Where x is what a model predicts of y at the same stamps, hold, sampling and leakage are alike in both, and R
is 1 at every line where the model is right.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rsea_ros.errors import RseaError
from rsea_ros.model.extent import is_too_fast
from rsea_ros.model.inverse import is_inverse, motion_from, torques_along
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import BoolArray, Channel, ComplexArray, FloatArray, IntArray, Record
from rsea_ros.records.statistics import next_fast_length, segment_spectra

_SEGMENTS = 5
"""A record is cut into segments of a fifth: slow ramps still have their line, and nine of them overlap."""
_LONGEST = 8.0
"""s. Of a segment, where the record has more than five such."""
_FEWEST = 16
"""Samples of a segment, at rates that put fewer into its longest."""
_LINES = 48
_ENOUGH = 0.3
"""Of the predicted power: lines that hold less say nothing of a channel."""
_FIRST = 2
_TINY = 1e-300
FALSE_ALARM = 1e-3


@dataclass(frozen=True)
class Quotient:
    """Measured over predicted in bands of about equal width on a logarithmic scale.

    frequency: Hz, shape (n,). value: complex, shape (n,). coherence: 0 to 1, shape (n,).
    sd: standard deviation of ln(value), shape (n,). weight: share of the predicted power, shape (n,).
    segments: how many independent ones. lines: how many lines bear the predicted power. related: coherence
    of all lines, each by its share of the predicted power.
    measured, predicted: RMS without mean, in the channel's unit. captured: share of the predicted power that
    these lines hold.
    """

    channel: str
    frequency: FloatArray
    value: ComplexArray
    coherence: FloatArray
    sd: FloatArray
    weight: FloatArray
    segments: float
    lines: float
    related: float
    measured: float
    predicted: float
    captured: float

    @property
    def is_unrelated(self) -> bool:
        """Whether the channel has no more in common with the prediction than noise has by chance."""
        single = 1.0 - FALSE_ALARM ** (1.0 / max(self.segments - 1.0, 1.0))
        chance = 1.0 / self.segments
        limit = chance + (single - chance) / math.sqrt(max(self.lines, 1.0))
        return bool(self.related < limit and self.captured > _ENOUGH)


def quotient(channel: str, t: FloatArray, y: FloatArray, p: FloatArray) -> Quotient | None:
    """Return the quotient of measured y and predicted p at stamps t (s), None for too few samples."""
    if len(t) < 64 or not np.isfinite(p).all():
        return None
    clock, period = even(t)
    y, p = (np.interp(clock, t, v) for v in (y, p))
    measured, predicted = float(np.std(y)), float(np.std(p))
    if len(clock) < _FEWEST * _SEGMENTS or not (predicted > 0.0 and measured > 0.0):
        return None
    length = _length(len(clock), period)
    pp = _segments(p, length)
    if (captured := float(_captured_share(pp, p))) < _ENOUGH:  # slow: short segments have no line for it
        length = len(clock) // _SEGMENTS
        pp = _segments(p, length)
        captured = float(_captured_share(pp, p))
    yy = _segments(y, length)
    cross = np.sum(yy * pp.conj(), axis=0)
    power_y, power_p = (np.sum(np.abs(v) ** 2, axis=0) + _TINY for v in (yy, pp))
    segments = len(yy) / (1.0 + 2.0 / 36.0) if len(yy) > 1 else 1.0
    share = power_p / power_p.sum()
    bands = _bands(len(cross))
    s_yp: ComplexArray = np.add.reduceat(cross, bands)
    s_pp, s_yy = (np.add.reduceat(v, bands) for v in (power_p, power_y))
    width = np.diff(np.append(bands, len(cross)))
    coherence = np.abs(s_yp) ** 2 / (s_pp * s_yy)
    averages = np.maximum(segments * width, 2.0)
    return Quotient(
        channel=channel,
        frequency=np.add.reduceat(np.arange(len(cross)) + _FIRST, bands) / width / (length * period),
        value=s_yp / s_pp, coherence=coherence,
        sd=np.sqrt(np.maximum(1.0 - coherence, 1e-6) / (2.0 * np.maximum(coherence, 1e-9) * averages)),
        weight=np.add.reduceat(share, bands), segments=segments, lines=1.0 / float(np.sum(share**2)),
        related=float(np.sum(share * np.abs(cross) ** 2 / (power_y * power_p))), measured=measured,
        predicted=predicted, captured=captured,
    )


def even(t: FloatArray) -> tuple[FloatArray, float]:
    """Return stamps a median period of t apart, and this, s."""
    steps = np.sort(np.diff(t))  # numpy's median takes 20 us more
    period = float(0.5 * (steps[(len(steps) - 1) // 2] + steps[len(steps) // 2]))
    return np.arange(t[0], t[-1], period), period


def related(y: FloatArray, p: FloatArray, period: float) -> FloatArray:
    """Return `related` of the quotients of each row of y and p, samples a period (s) apart; -1 where is none.

    y, p: shape (k, n), or (1, n) of a channel that is the same in all.
    """
    n = y.shape[1]
    if n < _FEWEST * _SEGMENTS:
        return np.full(max(len(y), len(p)), -1.0)
    length = _length(n, period)
    pp = _segments(p, length)
    found = _related(_segments(y, length), pp)
    if (slow := _captured_share(pp, p) < _ENOUGH).any():
        found = np.where(slow, _related(*(_segments(v, n // _SEGMENTS) for v in (y, p))), found)
    return np.where((np.ptp(y, axis=1) > 0.0) & (np.ptp(p, axis=1) > 0.0), found, -1.0)


def _related(yy: ComplexArray, pp: ComplexArray) -> FloatArray:
    cross = np.abs(np.sum(yy * pp.conj(), axis=1)) ** 2
    power_y, power_p = (np.sum(np.abs(v) ** 2, axis=1) + _TINY for v in (yy, pp))
    return np.asarray(np.sum(cross / power_y, axis=1) / power_p.sum(axis=1))


def _length(samples: int, period: float) -> int:
    """Return the samples of a segment, at a period in s."""
    return min(samples // _SEGMENTS, next_fast_length(max(_FEWEST, int(_LONGEST / period))))


def _captured_share(spectra: ComplexArray, values: FloatArray) -> FloatArray:
    """Return the share of a signal's power that its segments' lines hold, shape (...) for values (..., n)."""
    power = 2.0 * np.mean(np.sum(np.abs(spectra) ** 2, axis=-1), axis=-1)
    return np.asarray(power / (0.375 * (2.0 * spectra.shape[-1]) ** 2) / np.var(values, axis=-1))


def usable(q: Quotient) -> BoolArray:
    """Return the informative bands: coherent, and with more than a trace of the predicted power."""
    return np.asarray((q.coherence > 0.3) & (q.weight > 1e-7 * q.weight.max()) & np.isfinite(q.sd))


def _segments(values: FloatArray, length: int) -> ComplexArray:
    """Return the spectra of half-overlapping Hann segments from the second line on, (..., k, lines)."""
    spectra = segment_spectra(values, length)
    return spectra[..., _FIRST : int(0.9 * spectra.shape[-1])]


@lru_cache(maxsize=64)
def _bands(lines: int) -> IntArray:
    """Return where each band begins, shape (bands,)."""
    edges = np.geomspace(1.0, lines + 1.0, _LINES + 1)[:-1]
    return np.unique(np.floor(edges).astype(np.int64) - 1)


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
            if is_inverse(rig):
                return _inverse(record, rig)
            predicted = {n: p for n, p in simulate(rig, record).items() if np.isfinite(p).all()}
            return {n: Side(record[n].t, record[n].y, p) for n, p in predicted.items()}
    except (RseaError, ValueError, np.linalg.LinAlgError):
        return {}


def _inverse(record: Record, rig: Rig) -> Mapping[str, Side]:
    if "position" not in record:
        return {}
    motion = motion_from(record, rig)
    known = motion.counts if motion.counts.any() else np.ones(len(motion.t), bool)
    taken = torques_along(rig, motion)
    return {n: Side(motion.t[known], y[known], taken[n][known]) for n, y in motion.judged.items()}


def is_full_of_gaps(record: Record) -> bool:
    """Return whether the record lasts much longer than its samples do: a clock that was set."""
    t = record["command"].t
    period = float(np.median(np.diff(t)))
    return not period > 0.0 or record.stop - record.start > MOST_STEPS * period * len(t)


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
    return np.asarray(change > max(min(_CLEARLY * quiet, 0.5 * largest), 1e-3 * largest))
