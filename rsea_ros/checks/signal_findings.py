"""Findings on single signals: noise, rate, offset, standstill, jumps of angles, smoothed velocities.

Measured over predicted of a channel, over the same of another one, is the response H of its sensor times a
gain: errors of drive, inertia and damping are in both. An average of the last n samples has

    H(f) = sin(pi f n T) / (n sin(pi f T)) exp(-i pi f (n - 1) T)

and one of the samples on either side, made after the run, has its size without its lag. Below its resonance,
a mode at the other sensor looks alike: it raises that one's response as an average lowers this one's.
"""

import math
from collections.abc import Collection, Iterator, Mapping

import numpy as np

from rsea_ros.checks.expected import Quotient, Side, at_rest, moves, usable
from rsea_ros.checks.finding import Finding
from rsea_ros.checks.stamp_findings import command_band, natural_frequency
from rsea_ros.identification.noise import noise_floor
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import (
    SENSED,
    UNITS,
    BoolArray,
    Channel,
    ComplexArray,
    FloatArray,
    IntArray,
    Record,
)
from rsea_ros.records.statistics import running_integral, runs_of

_MOSTLY = 0.5
_WORTH_TELLING = 0.02
_LOUD = 10.0
"""Times the rig's noise: friction and play leave up to seven times that without the command's coherence."""
_MORE = 2.0
"""Times the rig's noise, from which a motion that is as rough explains it."""
_EXCITE = "excite it: `rsea simulate --help` lists the excitations, the node `excite` plays them"


def excitation(record: Record, rig: Rig) -> Iterator[Finding]:
    """Yield the findings on the command: its band and size, and the share of the record at rest."""
    command = record["command"]
    if float(np.ptp(command.y)) == 0.0:
        yield Finding(
            "red", "excitation", "command", float(command.y[0]), "N m",
            expected="a command that changes", detail="the command never changes", remedy=_EXCITE,
        )
        return
    low, high = command_band(command)
    rms, peak = float(np.std(command.y)), float(np.max(np.abs(command.y)))
    detail = f"{low:.3g} to {high:.3g} Hz, peak {peak:.3g} N·m"
    natural = natural_frequency(rig)
    if natural is not None and high < 0.5 * natural:
        yield Finding(
            "amber", "excitation", "command", rms, "N m", expected=f"a band beyond {natural:.3g} Hz",
            detail=detail, remedy="excite up to twice the rig's natural frequency",
        )
    else:
        yield Finding("green", "excitation", "command", rms, "N m", detail=detail)
    if (share := at_rest(record)) >= _WORTH_TELLING:
        yield Finding(
            "amber" if share > _MOSTLY else "green", "rest", "", 100.0 * share, "%",
            expected=f"less than {100.0 * _MOSTLY:.0f} %", detail="of the record is at rest",
            remedy="cut it with --from and --to" if share > _MOSTLY else "",
        )


def noises(record: Record, rig: Rig, but: Collection[str] = ()) -> Iterator[Finding]:
    """Yield the noise of every sensor beside the rig's. record: finite values, rising stamps.

    The floor of the spectrum holds what friction and play add; differences from sample to sample do not. Both
    must be loud; else the smaller is the noise, and not less than what the rig states.
    but: channels of which a part was masked and bridged.
    """
    for name, sensor in rig.sensors.items():
        if name not in record or name in but or "command" not in record or len(record[name]) < 64:
            continue
        stated = max(sensor.noise, 0.5 * sensor.quantum)
        fourth = np.abs(np.diff(record[name].y, 4))  # differences in which smooth motion hardly appears
        floor, rough = noise_floor(record, name, sensor), float(np.median(fourth)) / 0.6745 / math.sqrt(70.0)
        loud = stated > 0.0 and min(floor, rough) > _LOUD * stated and name != "motor_torque"
        noise = floor if loud else min(floor, max(rough, stated))
        yield Finding(
            "amber" if loud else "green", "noise", name, noise, UNITS[name],
            expected=f"about {stated:.3g}" if stated else "", detail=_times(noise, stated),
            remedy="look at cable and filter, or state this noise in the rig" if loud else "",
        )


def _times(noise: float, stated: float) -> str:
    """Return the noise over the rig's: an upper bound where a motion as rough would look the same."""
    if stated <= 0.0:
        return "the rig states none"
    times = f"{noise / stated:.2g} times the rig's"
    return f"at most {times}: the motion may be as rough" if _MORE < noise / stated <= _LOUD else times


_LARGE, _FAR = 1.0, 3.0
"""Times the largest torque of the run: a zero that was never set; an offset that no zero explains."""


def offset_findings(record: Record, compared: Mapping[str, Side]) -> Iterator[Finding]:
    """Yield the finding of an F/T torque that lies far from what the rig would give.

    compared: the record beside the rig's simulation, which has the gravity of its loads.
    """
    side = compared.get("ft")
    if side is None or "command" not in record:
        return
    offset = float(np.median(side.y) - np.median(side.p))
    largest = max(float(np.max(np.abs(record["command"].y))), float(np.max(np.abs(side.p))))
    if abs(offset) <= _LARGE * largest:
        return
    yield Finding(
        "red" if abs(offset) > _FAR * largest else "amber", "offset", "ft", offset, "N m",
        expected=f"less than {largest:.3g}, the largest torque of the run",
        detail=f"{abs(offset) / largest:.2g} times that torque at all times",
        remedy="set the sensor's zero, look at its mount, or give the constant in the import map",
    )


def angle_offset_findings(rig: Rig, compared: Mapping[str, Side]) -> Iterator[Finding]:
    """Yield the finding of a position whose whole range lies away from where the rig would be."""
    side = compared.get("position")
    if side is None or rig.zero_unknown("position"):
        return
    middle, rest = float(np.median(side.y)), float(np.median(side.p))
    if min(abs(middle), abs(middle - rest)) <= float(np.ptp(side.y)):
        return
    yield Finding(
        "red", "offset", "position", middle - rest, "rad",
        expected=f"motion about {rest:.3g}, where the rig rests",
        detail=f"all of the motion is about {middle:.4g} rad; fits compare its changes alone",
        remedy="`zero_unknown: true` for position in the rig, or give the constant in the import map",
    )


_LONGEST, _SHARE = 1.0, 0.1
"""s, and share of the record: a shorter standstill is one of friction at a turn of the command."""
_AROUND, _FEWEST, _MOSTLY_STILL = 0.25, 9, 0.8
"""s, samples, and share of them: noise passes for motion now and then, a turn of the command for rest."""
_HARDLY = 0.1
"""Of its range: a sensor at rest has noise, and the end of a motion that fades."""
_GOES_ON = 0.3
"""Share of that time in which the command changes clearly."""


def standstill_findings(record: Record) -> Iterator[Finding]:
    """Yield the finding of the longest standstill under a command. record: finite values, rising stamps."""
    sensors = [record[n] for n in SENSED if n in record and np.ptp(record[n].y) > 0.0]
    if "command" not in record or not sensors or np.ptp(record["command"].t) < _LONGEST:
        return
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
        return
    if length < max(_LONGEST, _SHARE * float(t[-1] - t[0])) or command[first : last + 1].mean() < _GOES_ON:
        return
    yield Finding(
        "amber", "standstill", "", length, "s", expected="motion while the command changes",
        detail=f"from {t[first]:.4g} s to {t[last]:.4g} s nothing moves while the command goes on",
        remedy="was the motor on, the command above the friction? If not, cut the record there",
    )


def _rests(channel: Channel, start: float, stop: float) -> bool:
    """Return whether a channel changes between two times, s, by a small part of its range in the run."""
    y = channel.between(start + _AROUND, stop - _AROUND).y
    return bool(len(y) and np.ptp(y) < _HARDLY * np.ptp(channel.y))


def _longest(still: BoolArray, t: FloatArray) -> tuple[int, int]:
    """Return the first and the last sample of the longest run."""
    runs = runs_of(still) - (0, 1)
    if not len(runs):
        return 0, 0
    first, last = runs[np.argmax(np.diff(t[runs])[:, 0])]
    return int(first), int(last)


_LARGE_JUMP = 10.0
"""Times the largest usual step: a motion has no step so much larger than those beside it."""
_USUAL = 0.99
"""Quantile of the steps: jumps are fewer than the rest of them."""
_CONTRADICTED = 0.2
"""Of a jump: what the measured velocity brings in that time where the machine did not make it."""
_TURN = 2.0 * math.pi
_NEAR_TURN = 0.05
"""Of a turn."""
_FEWEST_JUMPS = 64
"""Samples that show what steps are usual."""


def jump_findings(record: Record) -> list[Finding]:
    """Return a finding for each angle that jumps. record: finite values, rising stamps."""
    return [f for n in ("position", "deflection") if n in record for f in _of_angle(record, n)]


def _of_angle(record: Record, name: str) -> Iterator[Finding]:
    channel = record[name]
    at = _jumps(channel)
    sizes = np.diff(channel.y)[at]
    turns = np.abs(np.abs(sizes) - _TURN) < _NEAR_TURN * _TURN
    made_up = turns | _is_contradicted(record, at, sizes) if name == "position" else turns
    if not made_up.any():
        return
    first = int(np.argmax(made_up))
    where = f"by {sizes[first]:.3g} rad at {channel.t[at[first] + 1]:.4g} s"
    why = "the velocity did not make it"
    remedy = "cut the record there with --from or --to: the encoder began to count anew"
    if turns[first]:
        why = "a whole turn"
        remedy = '`expression: "unwrap(…)"` in the import map, or publish the angle unwrapped'
    yield Finding(
        "red", "angle_jumps", name, float(np.count_nonzero(made_up)), "1", expected="none",
        detail=f"{where}: {why}", remedy=remedy,
    )


def _jumps(channel: Channel) -> IntArray:
    """Return before which jumps the samples stand: steps far larger than all beside them."""
    step = np.abs(np.diff(channel.y))
    if len(step) < _FEWEST_JUMPS:
        return np.empty(0, np.int64)
    usual = float(np.quantile(step, _USUAL))
    large = step > _LARGE_JUMP * max(usual, 1e-12)
    return np.flatnonzero(large & ~np.roll(large, 1) & ~np.roll(large, -1))


def _is_contradicted(record: Record, at: IntArray, sizes: FloatArray) -> BoolArray:
    """Return for which jumps the measured velocity says that the machine made none.

    Behind samples that repeat, a jump is of all the motion since the first of them.
    """
    if "velocity" not in record or not len(at):
        return np.zeros(len(at), bool)
    position, velocity = record["position"], record["velocity"]
    t, speed = position.t, np.interp(position.t, velocity.t, velocity.y)
    turned = running_integral(speed, t)
    new = np.diff(position.y, prepend=np.nan) != 0.0
    since = np.maximum.accumulate(np.where(new, np.arange(len(t)), 0))[at]
    brought = np.maximum(np.abs(speed[at]), np.abs(speed[at + 1])) * (t[at + 1] - t[at])
    brought = np.maximum(brought, np.abs(turned[at + 1] - turned[since]))
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
        "amber", "smoothing", name, 1e3 * number * period, "ms", expected="none",
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
    return np.asarray(np.abs(response - gain[:, None] * h) ** 2 @ weight / (np.abs(response) ** 2 @ weight))
