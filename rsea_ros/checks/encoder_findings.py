"""Findings on an encoder: angles that jump, and a velocity that its maker has smoothed.

Measured over predicted of a channel, over the same of another one, is the response H of its sensor times a
gain: errors of drive, inertia and damping are in both. An average of the last n samples has

    H(f) = sin(pi f n T) / (n sin(pi f T)) exp(-i pi f (n - 1) T)

and one of the samples on either side, made after the run, has its size without its lag. Below its resonance,
a mode at the other sensor looks alike: it raises that one's response as an average lowers this one's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rsea_ros.checks.channel_spectra import Quotient, usable
from rsea_ros.checks.finding import Finding
from rsea_ros.records.record import SENSED, BoolArray, Channel, ComplexArray, FloatArray, IntArray, Record

_LARGE = 10.0
"""Times the largest usual step: a motion has no step so much larger than those beside it."""
_USUAL = 0.99
"""Quantile of the steps: jumps are fewer than the rest of them."""
_CONTRADICTED = 0.2
"""Of a jump: what the measured velocity brings in that time where the machine did not make it."""
_TURN = 2.0 * math.pi
_NEAR_TURN = 0.05
"""Of a turn."""
_FEWEST = 64
"""Samples that show what steps are usual."""


def jump_findings(record: Record) -> list[Finding]:
    """Return a finding for each angle that jumps. record: finite values, rising stamps."""
    return [f for n in ("position", "deflection") if n in record for f in _of_angle(record, n)]


def _of_angle(record: Record, name: str) -> list[Finding]:
    channel = record[name]
    at = _jumps(channel)
    sizes = np.diff(channel.y)[at]
    turns = np.abs(np.abs(sizes) - _TURN) < _NEAR_TURN * _TURN
    made_up = turns | _is_contradicted(record, at, sizes) if name == "position" else turns
    if not made_up.any():
        return []
    first = int(np.argmax(made_up))
    wrapped = bool(turns[first])
    where = f"by {sizes[first]:.3g} rad at {channel.t[at[first] + 1]:.4g} s"
    return [
        Finding(
            "red",
            "angle_jumps",
            name,
            float(np.count_nonzero(made_up)),
            "1",
            expected="none",
            detail=f"{where}: {'a whole turn' if wrapped else 'the velocity did not make it'}",
            remedy='`expression: "unwrap(…)"` in the import map, or publish the angle unwrapped'
            if wrapped
            else "cut the record there with --from or --to: the encoder began to count anew",
        )
    ]


def _jumps(channel: Channel) -> IntArray:
    """Return before which jumps the samples stand: steps far larger than all beside them."""
    step = np.abs(np.diff(channel.y))
    if len(step) < _FEWEST:
        return np.empty(0, np.int64)
    usual = float(np.quantile(step, _USUAL))
    large = step > _LARGE * max(usual, 1e-12)
    alone = large & ~np.roll(large, 1) & ~np.roll(large, -1)
    return np.flatnonzero(alone)


def _is_contradicted(record: Record, at: IntArray, sizes: FloatArray) -> BoolArray:
    """Return for which jumps the measured velocity says that the machine made none."""
    if "velocity" not in record or not len(at):
        return np.zeros(len(at), bool)
    t, velocity = record["position"].t, record["velocity"]
    around = [np.abs(np.interp(t[k], velocity.t, velocity.y)) for k in (at, at + 1)]
    brought = np.maximum(*around) * (t[at + 1] - t[at])
    return np.asarray(brought < _CONTRADICTED * np.abs(sizes))


_MOST = 60
"""Samples of the longest average that is tried."""
_LAGS = np.geomspace(2e-4, 0.1, 60)
"""s. Time constants of a lag, which is a sensor's, not a program's."""
_MODE_FREQUENCIES, _PARTICIPATIONS = np.geomspace(1.05, 6.0, 12), np.geomspace(0.1, 2.0, 8)
"""Of modes at the other sensor: times the highest line, and share of its torque or motion."""
_FALLS = 0.2
"""Of what no filter leaves, and of what the best lag or mode leaves: the average must leave less."""
_FITS = 0.15
"""Of the response: what the average may leave."""
_FEWEST_RATES = 8


def smoothing_findings(related: Mapping[str, Quotient], periods: Mapping[str, float]) -> list[Finding]:
    """Return the findings of channels that are moving averages. periods: of the samples by channel, s."""
    by_channel = {n: _average_of(n, related, periods[n]) for n in SENSED if n in related}
    return [
        _finding(n, number, centred, periods[n]) for n, (number, centred) in by_channel.items() if number > 1
    ]


def _finding(name: str, number: int, centred: bool, period: float) -> Finding:
    of = "a centred moving average" if centred else "a moving average"
    takes = "spring and damping that are not the machine's" if centred else "its lag for the machine's"
    return Finding(
        "amber",
        "smoothing",
        name,
        1e3 * number * period,
        "ms",
        expected="none",
        detail=f"looks like {of} of {number} samples",
        remedy=f"log the sensor unfiltered: a fit takes {takes}",
    )


def _average_of(name: str, related: Mapping[str, Quotient], period: float) -> tuple[int, bool]:
    """Return over how many samples a channel was averaged beside any other, and whether without a lag."""
    smoothed = related[name]
    for other in (related[n] for n in SENSED if n in related and n != name):
        if not np.array_equal(smoothed.frequency, other.frequency):
            continue
        keep = usable(smoothed) & usable(other)
        if np.count_nonzero(keep) < _FEWEST_RATES:
            continue
        response, sd = smoothed.value / other.value, np.hypot(smoothed.sd, other.sd)
        number, centred = _average(smoothed.frequency[keep], response[keep], sd[keep], period)
        if number > 1:
            return number, centred
    return 1, False


def _average(f: FloatArray, response: ComplexArray, sd: FloatArray, period: float) -> tuple[int, bool]:
    """Return over how many samples a response was averaged, 1 for none, and whether without a lag."""
    weight = 1.0 / (sd**2 + 0.05**2)
    turn, number = np.pi * f * period, np.arange(2.0, _MOST + 1.0)[:, None]
    size = np.sin(number * turn) / (number * np.sin(turn))
    averages = np.asarray(size * np.exp(-1j * (number - 1.0) * turn), dtype=np.complex128)
    none = np.ones((1, len(f)), complex)
    tried = _share_left(response, np.vstack([none, averages, none, size[1::2]]), weight)
    alike = _share_left(response, np.vstack([_lags(f), _modes(f)]), weight).min()
    best = int(np.argmin(tried))
    if not (tried[best] < _FALLS * min(tried[0], alike) and tried[best] < _FITS**2):
        return 1, False
    return (best + 1, False) if best < _MOST else (2 * (best - _MOST) + 1, True)


def _lags(f: FloatArray) -> ComplexArray:
    """Return the responses of lags of first order, shape (k, n)."""
    return np.asarray(1.0 / (1.0 + 2j * np.pi * f * _LAGS[:, None]), dtype=np.complex128)


def _modes(f: FloatArray) -> ComplexArray:
    """Return the responses over those of a sensor with an undamped mode above the lines, shape (k, n).

    1 / (1 + p f^2 / (f_0^2 - f^2)), p the participation.
    """
    ratio = (f / (_MODE_FREQUENCIES[:, None] * f.max())) ** 2
    raised = ratio / (1.0 - ratio)
    modes = 1.0 / (1.0 + _PARTICIPATIONS[:, None, None] * raised)
    return np.asarray(modes.reshape(-1, len(f)), dtype=np.complex128)


def _share_left(response: ComplexArray, h: ComplexArray, weight: FloatArray) -> FloatArray:
    """Return the share of a response's power that each filter leaves at its best gain. h: shape (k, n)."""
    gain = (h.conj() * response).real @ weight / (np.abs(h) ** 2 @ weight)
    share: FloatArray = np.abs(response - gain[:, None] * h) ** 2 @ weight / (np.abs(response) ** 2 @ weight)
    return share
