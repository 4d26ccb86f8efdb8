"""Findings on single signals: noise, rate, offset, standstill."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from numpy.fft import rfft, rfftfreq

from rsea_ros.checks.expected import Side, at_rest, moves
from rsea_ros.checks.finding import Finding
from rsea_ros.checks.stamp_findings import natural_frequency
from rsea_ros.identification.noise import noise_floor
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import SENSED, UNITS, BoolArray, Channel, FloatArray, Record

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


_LARGE, _FAR = 1.0, 3.0
"""Times the largest torque of the run: a zero that was never set; an offset that no zero explains."""


def offset_findings(record: Record, compared: Mapping[str, Side]) -> list[Finding]:
    """Return the finding of an F/T torque that lies far from what the rig would give.

    compared: the record beside the rig's simulation, which has the gravity of its loads.
    """
    side = compared.get("ft")
    if side is None or "command" not in record:
        return []
    offset = float(np.median(side.y) - np.median(side.p))
    largest = max(float(np.max(np.abs(record["command"].y))), float(np.max(np.abs(side.p))))
    if abs(offset) <= _LARGE * largest:
        return []
    return [
        Finding(
            "red" if abs(offset) > _FAR * largest else "amber",
            "offset",
            "ft",
            offset,
            "N m",
            expected=f"less than {largest:.3g}, the largest torque of the run",
            detail=f"{abs(offset) / largest:.2g} times that torque at all times",
            remedy="set the sensor's zero, look at its mount, or give the constant in the import map",
        )
    ]


def angle_offset_findings(rig: Rig, compared: Mapping[str, Side]) -> list[Finding]:
    """Return the finding of a position whose whole range lies away from where the rig would be."""
    side = compared.get("position")
    if side is None or rig.zero_unknown("position"):
        return []
    middle, rest = float(np.median(side.y)), float(np.median(side.p))
    if min(abs(middle), abs(middle - rest)) <= float(np.ptp(side.y)):
        return []
    return [
        Finding(
            "red",
            "offset",
            "position",
            middle - rest,
            "rad",
            expected=f"motion about {rest:.3g}, where the rig rests",
            detail=f"all of the motion is about {middle:.4g} rad; fits compare its changes alone",
            remedy="`zero_unknown: true` for position in the rig, or give the constant in the import map",
        )
    ]


_LONGEST, _SHARE = 1.0, 0.1
"""s, and share of the record: a shorter standstill is one of friction at a turn of the command."""
_AROUND, _FEWEST, _MOSTLY_STILL = 0.25, 9, 0.8
"""s, samples, and share of them: noise passes for motion now and then, a turn of the command for rest."""
_HARDLY = 0.1
"""Of its range: a sensor at rest has noise, and the end of a motion that fades."""
_GOES_ON = 0.3
"""Share of that time in which the command changes clearly."""


def standstill_findings(record: Record) -> list[Finding]:
    """Return the finding of the longest standstill under a command. record: finite values, rising stamps."""
    sensors = [record[n] for n in SENSED if n in record and np.ptp(record[n].y) > 0.0]
    if "command" not in record or not sensors or np.ptp(record["command"].t) < _LONGEST:
        return []
    command, t = moves(record["command"]), record["command"].t
    still = np.ones(len(t), bool)
    for channel in sensors:
        moved = moves(channel)
        covered = (t >= channel.t[0]) & (t <= channel.t[-1])
        still &= covered & ~moved[np.clip(np.searchsorted(channel.t, t), 0, len(moved) - 1)]
    around = min(max(_FEWEST, round(_AROUND * record["command"].rate)), len(t))
    mostly = np.convolve(still, np.full(around, 1.0 / around), "same") > _MOSTLY_STILL
    first, last = _longest(mostly, t)
    length = float(t[last] - t[first])
    if not all(_rests(channel, float(t[first]), float(t[last])) for channel in sensors):
        return []
    if length < max(_LONGEST, _SHARE * float(t[-1] - t[0])) or command[first : last + 1].mean() < _GOES_ON:
        return []
    return [
        Finding(
            "amber",
            "standstill",
            "",
            length,
            "s",
            expected="motion while the command changes",
            detail=f"from {t[first]:.4g} s to {t[last]:.4g} s nothing moves while the command goes on",
            remedy="was the motor on, the command above the friction? If not, cut the record there",
        )
    ]


def _rests(channel: Channel, start: float, stop: float) -> bool:
    """Return whether a channel changes between two times, s, by a small part of its range in the run."""
    y = channel.between(start + _AROUND, stop - _AROUND).y
    return bool(len(y) and np.ptp(y) < _HARDLY * np.ptp(channel.y))


def _longest(still: BoolArray, t: FloatArray) -> tuple[int, int]:
    """Return the first and the last sample of the longest run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    if not len(edges):
        return 0, 0
    k = int(np.argmax(t[edges[1::2] - 1] - t[edges[::2]]))
    return int(edges[::2][k]), int(edges[1::2][k] - 1)
