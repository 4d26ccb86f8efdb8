"""Findings about the signals: excitation, rest, noise."""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
from numpy.fft import rfft, rfftfreq

from rsea_ros.checks.finding import Finding
from rsea_ros.checks.moved_spans import at_rest
from rsea_ros.checks.stamp_findings import natural_frequency
from rsea_ros.identification.noise import noise_floor
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import UNITS, Channel, Record

_MOSTLY = 0.5
_WORTH_TELLING = 0.02
_LOUD = 10.0
"""Times the rig's noise: friction and play leave up to seven times that without the command's coherence."""
_BAND = (0.01, 0.99)
"""Of the command's power: between these quantiles lies its band."""
_EXCITE = "excite it: `rsea simulate --help` lists the excitations, the node `excite` plays them"


def excitation(record: Record, rig: Rig) -> list[Finding]:
    """Return the findings on the command: its band and size, and the share of the record at rest."""
    command = record["command"]
    if float(np.ptp(command.y)) == 0.0:
        return [
            Finding(
                "red",
                "excitation",
                "command",
                float(command.y[0]),
                "N m",
                expected="a command that changes",
                detail="the command never changes",
                remedy=_EXCITE,
            )
        ]
    low, high = band(record)
    rms, peak = float(np.std(command.y)), float(np.max(np.abs(command.y)))
    detail = f"{low:.3g} to {high:.3g} Hz, peak {peak:.3g} N·m"
    natural = natural_frequency(rig)
    if natural is not None and high < 0.5 * natural:
        first = Finding(
            "amber",
            "excitation",
            "command",
            rms,
            "N m",
            expected=f"a band beyond {natural:.3g} Hz",
            detail=detail,
            remedy="excite up to twice the rig's natural frequency",
        )
    else:
        first = Finding("green", "excitation", "command", rms, "N m", detail=detail)
    return [first, *_rest(at_rest(record))]


def _rest(share: float) -> list[Finding]:
    if share < _WORTH_TELLING:
        return []
    return [
        Finding(
            "amber" if share > _MOSTLY else "green",
            "rest",
            "",
            100.0 * share,
            "%",
            expected=f"less than {100.0 * _MOSTLY:.0f} %",
            detail="of the record is at rest",
            remedy="cut it with --from and --to" if share > _MOSTLY else "",
        )
    ]


def band(record: Record) -> tuple[float, float]:
    """Return the frequencies, Hz, between which the command's power lies."""
    command = record["command"]
    even = np.interp(np.arange(command.t[0], command.t[-1], 1.0 / command.rate), command.t, command.y)
    frequency, power = rfftfreq(len(even), 1.0 / command.rate), np.abs(rfft(even - even.mean())) ** 2
    share = np.cumsum(power) / max(float(power.sum()), 1e-300)
    low, high = (float(frequency[min(int(np.searchsorted(share, q)), len(share) - 1)]) for q in _BAND)
    return low, high


def noises(record: Record, rig: Rig, but: Collection[str] = ()) -> list[Finding]:
    """Return the noise of every sensor beside the rig's. record: finite values, rising stamps.

    but: channels of which a part was masked and bridged.
    """
    findings = []
    for name, sensor in rig.sensors.items():
        if name not in record or name in but or "command" not in record or len(record[name]) < 64:
            continue
        stated = max(sensor.noise, 0.5 * sensor.quantum)
        noise = noise_floor(record, name, sensor)
        loud = stated > 0.0 and min(noise, _rough(record[name])) > _LOUD * stated and name != "motor_torque"
        unit = UNITS[name]
        findings.append(
            Finding(
                "amber" if loud else "green",
                "noise",
                name,
                noise,
                unit,
                expected=f"about {stated:.3g}" if stated else "",
                detail=_times(noise, stated),
                remedy="look at cable and filter, or state this noise in the rig" if loud else "",
            )
        )
    return findings


def _rough(channel: Channel) -> float:
    """Return the RMS of white noise by fourth differences, in which smooth motion hardly appears."""
    return float(np.median(np.abs(np.diff(channel.y, 4)))) / 0.6745 / math.sqrt(70.0)


def _times(noise: float, stated: float) -> str:
    return f"{noise / stated:.2g} times the rig's" if stated > 0.0 else "the rig states none"
