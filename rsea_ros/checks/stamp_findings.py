"""Findings on stamps: gaps, jumps, repeats, and stamps rounded to a coarse clock.

Stamps at whole multiples of a step s, of samples whose period is no multiple of it, are off by up to s / 2.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.fft import rfft, rfftfreq

from rsea_ros.checks.finding import Finding, Light
from rsea_ros.identification.fit import SCATTER
from rsea_ros.model.extent import AS_SECONDS, FAST, SKIPPED_START, SLOW, is_slow, is_too_fast
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import Rig
from rsea_ros.records.holds import with_held_commands, words_on_steps
from rsea_ros.records.record import Channel, Fault, FloatArray, Record
from rsea_ros.records.stamp_order import GAP, local_period, polls_unevenly

_RED_SHARE = 0.2
"""Of a channel's samples: more bad ones make the channel, not some samples, doubtful."""
_PER_CYCLE = 4.0
"""Samples to a cycle of the rig's natural frequency, at least."""
_BAND = (0.01, 0.99)
"""Of the command's power: between these quantiles lies its band."""
_SLOW = 0.6
"""Of the command's rate: a slower sensor folds what is above its Nyquist frequency."""
_LEFT_OUT, _MUCH = ("mixed_rows", "stray_stamps"), 0.02
"""Faults whose rows are left out for their stamps, and the share of them that is red."""
_OF_ALL = ("missing_topic", "coarse_steps", "coarse_stamps", "rounded_stamps", "clock_jump", "pause",
           "partly_recorded", "early_torque", "held_samples", "interpolated", "mixed_rows")  # fmt: skip
"""Faults of a whole channel, whose share of its samples means nothing."""
_MENDED = ("early_torque",)
"""Faults that leave no doubt in a result once they are mended."""
_REMEDIES = {
    "missing_topic": "record it, or name its topic with --topic",
    "frozen_samples": "look at the sensor's driver: it repeats its last value",
    "interpolated": "log it as it arrives, without resampling; the samples between are left out",
    "held_samples": "log it as it arrives; the repeats are left out",
    "dropped_samples": "record with a deeper queue, on a quieter machine",
    "coarse_stamps": "log stamps as fine as the samples",
    "rounded_stamps": "log stamps as fine as the clock gives them",
    "partly_recorded": "start the recorder first and stop it last, or cut the run with --from and --to",
    "unnamed_file": "remove it, or give its own name to read it",
    "duplicate_stamps": "stamp at acquisition, not on arrival",
    "pause": "nothing to do, unless the zero of a sensor moved meanwhile: then cut the record there",
    "mixed_rows": "keep the clocks from being set during a run; --keep-rows leaves these rows in",
    "stray_stamps": "look at the clock; --keep-rows leaves these rows in",
    "clock_jump": "keep the clocks from being set during a run",
    "out_of_order": "sort by the stamps of the headers; nothing else to do",
    "early_torque": "stamp it when it was measured; nothing else to do",
    "outliers": "look for a loose cable; they are masked",
    "clipping": "widen the sensor's range, or excite less",
    "nan": "look at the driver; they are masked",
    "coarse_steps": "let the driver send full resolution",
    "dead_channel": "check cable, power and axis (--axis) of the sensor",
}


def fault_finding(fault: Fault) -> Finding:
    """Return the finding of a fault of the data."""
    bad = fault.kind == "dead_channel" or (fault.kind != "missing_topic" and fault.share > _RED_SHARE)
    whole = fault.kind in _OF_ALL
    bad = (bad and not whole) or (fault.kind in _LEFT_OUT and fault.share > _MUCH)
    light: Light = "red" if bad else "green" if fault.kind in _MENDED else "amber"
    share = None if whole or not math.isfinite(fault.share) else 100.0 * fault.share
    value, unit = (fault.size, fault.unit) if fault.size is not None else (share, "%" if share else "")
    return Finding(
        light, fault.kind, fault.channel, value, unit, expected="none", detail=fault.detail,
        remedy=_REMEDIES.get(fault.kind, ""),
    )


def rates(record: Record, rig: Rig, top: float = math.inf) -> list[Finding]:
    """Return the sample rate of every channel, and where it is too low for the rig.

    top: of the command's band, Hz.
    """
    held, _ = with_held_commands(record)
    natural, command = natural_frequency(rig), held["command"].rate if "command" in record else math.nan
    timed = {n: c for n, c in held.channels.items() if len(c) > 2}
    if is_too_fast(record):
        expected = f"more than {SKIPPED_START:g} s at up to {FAST:g} Hz"
        return [_other_unit(n, c, expected, "") for n, c in timed.items()]
    slow = is_slow(record)
    if slow and natural is None:
        return [_other_unit(n, c, f"> {SLOW:g} Hz", "record faster") for n, c in timed.items()]
    findings = [_rate(n, c, natural, command, top, slow) for n, c in timed.items()]
    words = words_on_steps(record)
    return [replace(f, detail=words[f.channel]) if f.channel in words else f for f in findings]


def _other_unit(name: str, channel: Channel, expected: str, otherwise: str) -> Finding:
    """Return the finding of a rate that speaks of stamps in another unit. otherwise: remedy if it is not."""
    lasts = f"{float(np.ptp(channel.t)):.3g} s of it"
    remedy = f"{AS_SECONDS}{f' If so, {otherwise}' if otherwise else ''}"
    return Finding("red", "rate", name, channel.rate, "Hz", expected=expected, detail=lasts, remedy=remedy)


def _rate(
    name: str, channel: Channel, natural: float | None, command: float, top: float, slow: bool
) -> Finding:
    """Return the finding of a channel's rate; amber where the command never excites what the rate hides.

    command: its rate, top: of its band, Hz. slow: all channels are, so that another unit is likely.
    """
    steps = np.diff(channel.t)
    rate = channel.rate
    longest = f"longest interval {1e3 * float(steps.max()):.3g} ms"
    local = local_period(channel.t)
    if max(local[0], local[-1]) > GAP * min(local[0], local[-1]) > 0.0:
        other = np.maximum(local / local[0], local[0] / local) > GAP
        at = channel.t[int(np.argmax(other))]
        longest = f"{1.0 / local[0]:.4g} Hz until {at:.4g} s, {1.0 / local[-1]:.4g} Hz at the end; {longest}"
    if 0.0 < rate < math.inf and polls_unevenly(steps, 1.0 / rate):
        low, high = 1e3 * np.quantile(steps, (0.05, 0.95))
        longest = f"uneven, mostly {low:.3g} to {high:.3g} ms; {longest}"
    if natural is not None and rate < _PER_CYCLE * natural:
        doubt = f"{AS_SECONDS} If so, " if slow else ""
        expected = f"> {_PER_CYCLE * natural:.3g} Hz, four samples to a cycle of the rig's {natural:.3g} Hz"
        light: Light = "amber" if _PER_CYCLE * top < rate and not slow else "red"
        return Finding(
            light, "rate", name, rate, "Hz", expected=expected, detail=longest,
            remedy=f"{doubt}record faster, or name the right rig with --rig",
        )
    if rate < _SLOW * command:
        return Finding(
            "amber", "rate", name, rate, "Hz", expected=f"{command:.4g} Hz as the commands",
            detail="slower than the commands: what is faster folds", remedy="record it faster",
        )
    return Finding("green", "rate", name, rate, "Hz", detail=longest)


def command_band(command: Channel) -> tuple[float, float]:
    """Return the frequencies, Hz, between which a command's power lies."""
    even = np.interp(np.arange(command.t[0], command.t[-1], 1.0 / command.rate), command.t, command.y)
    frequency, power = rfftfreq(len(even), 1.0 / command.rate), np.abs(rfft(even - even.mean())) ** 2
    share = np.cumsum(power) / max(float(power.sum()), 1e-300)
    low, high = (float(frequency[min(int(np.searchsorted(share, q)), len(share) - 1)]) for q in _BAND)
    return low, high


def natural_frequency(rig: Rig) -> float | None:
    """Return the lowest natural frequency of a rig, Hz; None where nothing oscillates, and in a loop."""
    if rig.loop is not None:
        return None
    roots = np.linalg.eigvals(state_space(rig).a)
    sizes = np.abs(roots[np.abs(roots.imag) > 1e-6 * np.abs(roots)])
    return float(sizes.min()) / (2.0 * math.pi) if len(sizes) else None


def order(record: Record) -> Iterator[Finding]:
    """Yield the channels whose stamps go back."""
    for name, channel in record.channels.items():
        back = int(np.count_nonzero(np.diff(channel.t) < 0.0))
        if back:
            yield Finding(
                "amber", "order", name, float(back), "1", expected="rising stamps",
                detail="stamps go back", remedy=_REMEDIES["out_of_order"],
            )


_STEPS = (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5)
"""s, to which loggers round."""
_NEAR = 0.01
"""Of a step: as near to a multiple stamps of 1.7e9 s are in a double, at steps of 10 µs and more."""
_OFTEN = 0.02
"""Share of the intervals: where fewer are no multiple of the usual one, samples are late."""
_FEWEST = 10
"""Intervals: of fewer any may be whole by chance."""


def rounded_stamps(channel: Channel, name: str) -> list[Fault]:
    """Return the fault of stamps that were rounded by more than a small part of the sample period."""
    interval = np.diff(channel.t)
    interval = interval[interval > 0.0]
    if len(interval) < _FEWEST:
        return []
    period = float(np.median(interval))
    step = next((s for s in _STEPS if _is_whole(interval, s)), 0.0)
    off = interval - period * np.rint(interval / period)  # behind lost samples it is some periods
    uneven = float(np.mean(np.abs(off) > 0.5 * step))
    if step / np.sqrt(12.0) < SCATTER * period or uneven < _OFTEN:
        return []
    detail = f"whole {_step_text(step)}, off by up to {1e3 * step / 2:g} ms at {channel.rate:.4g} Hz"
    return [Fault("rounded_stamps", name, 1.0, detail)]


def _is_whole(interval: FloatArray, step: float) -> bool:
    """Return whether all intervals, s, are whole multiples of a step."""
    places = interval / step
    whole = np.rint(places)
    return bool(np.all((whole > 0.0) & (np.abs(places - whole) < _NEAR)))


def _step_text(step: float) -> str:
    """Return a step, s, in the unit in which it is whole."""
    if step >= 1.0:
        return "s"
    size, unit = (1e3 * step, "ms") if step > 0.5e-3 else (1e6 * step, "µs")
    return unit if round(size) == 1 else f"multiples of {size:.0f} {unit}"
