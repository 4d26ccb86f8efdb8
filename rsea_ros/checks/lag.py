"""How late a channel comes against the rig's simulation, if it is too large for phases: seconds.

The lag at which measured and predicted values agree best, by their correlation within +-2 s. It counts only
where no other lag does nearly as well: a periodic command has many.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.fft import irfft, rfft

from rsea_ros.checks.expected import Side
from rsea_ros.checks.finding import Finding
from rsea_ros.records.record import Channel, FloatArray, Record
from rsea_ros.records.spectra import next_fast_length

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
_AROUND = 0.1
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
    aside = alike[np.abs(lag - lag[best]) > _AROUND]
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
            "red",
            "clock_offset",
            name,
            late,
            "s",
            expected="0",
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
