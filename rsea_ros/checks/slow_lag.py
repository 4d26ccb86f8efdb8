"""How late a slow channel comes: its samples are too far apart to be compared at whole periods.

The rig is simulated at the stamps of the commands, and the lag L is where the samples y(t_i) agree best with
p(t_i - L). As in lag.py it counts only where no other lag does nearly as well.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rsea_ros.checks.expected import Side, sides
from rsea_ros.checks.finding import Finding
from rsea_ros.checks.lag import NEAR, REACH, clear_lag, lag_of
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Channel, FloatArray, Record

_SLOW = 0.6
"""Of the commands' rate: a faster channel is compared at its periods."""
_FEWEST, _MOST = 16, 400
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
    kept = kept[np.linspace(0, len(kept) - 1, min(len(kept), _MOST)).astype(np.int64)]
    y, stamps = channel.y[kept], channel.t[kept]
    if len(y) < _FEWEST or not np.ptp(y) > 0.0:
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
            "green",
            "clock_offset",
            n,
            detail=f"not determined: {len(record[n])} samples at {record[n].rate:.3g} Hz do not show it",
            remedy="record it faster",
        )
        for n, lag in lags.items()
        if lag is None
    ]
