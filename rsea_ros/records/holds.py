"""Values that hold: commands sent on change alone, slow sensors, lost commands, a torque read at an edge.

A log of such a publisher has one message for each step, which may last for seconds, or pauses between spans
at the rate of a loop. What reads a record expects the commands of a control loop, one for each of its cycles.

A command takes effect at its stamp and holds. A torque that is read at that instant is, by convention, of the
command that just ended; a log that commands first and then reads holds the one that just began. Under white
commands the other one is wrong by all of its size, so the data decide; a torque of the commands that begin
moves into the time in which they hold.
"""

from dataclasses import replace

import numpy as np

from rsea_ros.records.record import (
    COMMANDS,
    MEASURED,
    SENSED,
    BoolArray,
    Channel,
    Fault,
    FloatArray,
    IntArray,
    Record,
)
from rsea_ros.records.stamp_order import GAP, NO_MULTIPLE, local_period

PERIODS = 10.0
"""Of a command: what a host that polls as it can lets pass, and for how long a motor torque speaks."""

AT_EDGE = 0.01
"""Of a command's period: stamps so near are one, rounded to nanoseconds in one of two channels."""
_LOST = 3.0
"""Times what the motor torque is off the commands elsewhere: in a pause that is further off others acted."""


def lost_commands(record: Record) -> list[tuple[float, float]]:
    """Return begin and end (s) of the steps between commands in which others acted, in order.

    Where a sensor went on, the last command held, unless the motor torque shows another one. Where none did,
    the recorder lost rows, unless the motor torque behind a few periods shows that nothing was sent in them.
    """
    command = next((record[n] for n in COMMANDS if n in record), None)
    step = np.diff(command.t if command is not None else [])
    if command is None or len(step) < 2 or not 0.0 < GAP * step.min() < step.max():  # out of order, or even
        return []
    period = local_period(command.t)
    few = (step > GAP * period) & (step <= PERIODS * period)
    off_a_tick = np.abs(step / period - np.rint(step / period))[few]
    on_ticks = few.any() and float(np.median(off_a_tick)) < NO_MULTIPLE
    long = np.flatnonzero(step > period * (GAP if on_ticks else PERIODS))
    held, lost = _torque_held(record, long), []
    sensors = [record[n].t for n in MEASURED if n in record]
    for k in long.tolist():
        begin, end = float(command.t[k]), float(command.t[k + 1])
        recorded = any(_goes_on(t, begin, end, GAP * period[k]) for t in sensors)
        short = step[k] <= PERIODS * period[k]
        if held.get(k) is False or not (recorded or (short and held.get(k))):
            lost.append((begin, end))
    return lost


def _torque_held(record: Record, long: IntArray) -> dict[int, bool]:
    """Return of some steps whether the motor torque in them is that of the last command, where it tells."""
    command, torque = record.channels.get("command"), record.channels.get("motor_torque")
    if command is None or torque is None or not len(long) or not np.isfinite(torque.y).any():
        return {}
    hold = _shown_commands(command, torque)
    off = np.square(torque.y - command.y[hold])
    known, paused = np.isfinite(off), np.isin(hold, long)
    if not (known & ~paused).any():
        return {}
    most = _LOST**2 * float(np.mean(off[known & ~paused]))
    differ = most < float(np.mean(np.square(np.diff(command.y))))  # else one command is as good as the next
    later = known & (torque.t > command.t[hold] + (1.0 + AT_EDGE) / command.rate)  # than any command acts
    within = {k: off[later & (hold == k)] for k in long.tolist()}
    far = {k: bool(np.mean(o) > most) for k, o in within.items() if len(o)}
    return {k: not is_far for k, is_far in far.items() if is_far or differ}


def _shown_commands(command: Channel, torque: Channel) -> IntArray:
    """Return the number of the command that each motor torque shows: the one at its stamp, or before it."""
    edge = AT_EDGE / command.rate
    ended, begun = (np.searchsorted(command.t, torque.t + side * edge) - 1 for side in (-1.0, 1.0))
    either = [np.maximum(k, 0) for k in (ended, begun)]
    return np.asarray(min(either, key=lambda k: np.nanmedian(np.abs(torque.y - command.y[k]))), np.int64)


_LONG = 32.0
"""Sample periods of the sensors that a value lasts, at the median: a step, no sample of a signal (a loop at
20 Hz beside sensors at 500 Hz is none)."""
_FEWEST = 2
_THROUGHOUT = 0.25
"""Of a pause: without a sample for no longer than that, a sensor shows that the recorder went on."""


def with_held_commands(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with a command in each sample period of its sensors, where each command is a step.

    In a pause of the commands alone, the last one is repeated at their usual rate. A note says so; no fault
    comes with it. The stamps of the steps are kept exactly, and the last one is held to the end of the
    sensors.
    """
    held = _held_steps(record)
    if not held:
        return record, []
    commands = {name: _hold_commands(record, name, steps) for name, steps in held.items()}
    notes = (f"{name}: {_words(record[name], steps)}" for name, steps in held.items())
    return replace(record.with_channels(**commands), notes=(*record.notes, *notes)), []


def words_on_steps(record: Record) -> dict[str, str]:
    """Return, for each channel of commands that are steps, how it is read."""
    return {name: _words(record[name], steps) for name, steps in _held_steps(record).items()}


def _words(channel: Channel, held: BoolArray) -> str:
    if held.all():
        return f"{len(channel)} messages, one for each change; each value is held until the next"
    lasts = np.where(held, np.diff(channel.t), 0.0)
    longest, count = int(np.argmax(lasts)), np.count_nonzero(held)
    return (
        f"{count} {'pauses' if count > 1 else 'pause'} of the commands alone, the longest "
        f"{lasts[longest]:.3g} s at {channel.t[longest]:.4g} s; the last value is held"
    )


def _held_steps(record: Record) -> dict[str, BoolArray]:
    """Return which steps to the next command a value is held over, shape (n - 1,), of channels with any."""
    held = {}
    for name in COMMANDS:
        if name in record:
            is_steps = _is_steps(record[name], _sensor_period(record))
            held[name] = np.ones(len(record[name]) - 1, np.bool_) if is_steps else paused_steps(record, name)
    return {name: steps for name, steps in held.items() if steps.any()}


def paused_steps(record: Record, name: str) -> BoolArray:
    """Return which steps between commands are pauses of their publisher, shape (n - 1,).

    A pause lasts for many of the commands' usual steps and of the sensors' sample periods, while a sensor
    goes on: the recorder lost nothing. Commands of a log that stops as a whole are lost, and those in whose
    place the motor torque shows others.
    """
    channel = record[name]
    step = np.diff(channel.t)
    if len(step) < _FEWEST or not np.isfinite(channel.y).all() or np.any(step <= 0.0):
        return np.zeros(len(step), np.bool_)
    usual = max(_sensor_period(record), float(np.median(step)))
    pauses: BoolArray = step >= _LONG * usual
    sensors = [record[n].t for n in MEASURED if n in record]
    for k in np.flatnonzero(pauses):
        pauses[k] = any(_goes_on(t, float(channel.t[k]), float(channel.t[k + 1])) for t in sensors)
    if name == "command" and pauses.any():
        pauses &= ~np.isin(channel.t[:-1], [begin for begin, _ in lost_commands(record)])
    return pauses


def _goes_on(t: FloatArray, start: float, stop: float, near: float = 0.0) -> bool:
    """Return whether stamps lie all about a span, s. near: so close to each other is close enough, s."""
    around = t[max(0, np.searchsorted(t, start, "right") - 1) : np.searchsorted(t, stop) + 1]
    if not len(around):
        return False
    longest = np.max(np.diff(around, prepend=min(start, around[0]), append=max(stop, around[-1])))
    return bool(longest <= max(near, _THROUGHOUT * (stop - start)))


def _hold_commands(record: Record, name: str, held: BoolArray) -> Channel:
    """Return a channel of commands with the values of its held steps repeated; steps alone to the end."""
    channel, last = record[name], float(record[name].t[-1])
    is_steps = bool(held.all())
    period = _sensor_period(record) if is_steps else float(np.median(np.diff(channel.t)))
    end = max(float(c.t[-1]) for c in record.channels.values() if len(c)) if is_steps else last
    return _repeat_values(channel, np.append(channel.t[1:], end), period, np.append(held, is_steps))


def _sensor_period(record: Record) -> float:
    """Return the shortest usual time between two samples of a sensor, s; infinite without one."""
    channels = (record[name] for name in MEASURED if name in record and len(record[name]) > _FEWEST)
    periods = [float(np.median(np.diff(channel.t))) for channel in channels]
    return min((p for p in periods if p > 0.0), default=np.inf)


def _is_steps(channel: Channel, period: float) -> bool:
    """Return whether every message is a change and most values last long. period: of the sensors, s."""
    if len(channel) < _FEWEST or not np.isfinite(channel.y).all() or np.any(np.diff(channel.t) <= 0.0):
        return False
    changes = bool(np.all(channel.y[1:] != channel.y[:-1]))
    return changes and float(np.median(np.diff(channel.t))) >= _LONG * period


def _repeat_values(channel: Channel, ends: FloatArray, period: float, which: BoolArray) -> Channel:
    """Return the channel with some samples repeated evenly until their ends, s. period: of the repeats, s."""
    lasts: FloatArray = ends - channel.t
    counts = np.where(which, np.maximum(1, np.rint(lasts / period)), 1).astype(np.int64)
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    t = np.repeat(channel.t, counts) + place * np.repeat(lasts / counts, counts)
    return Channel(t, np.repeat(channel.y, counts))


_FEWEST_VALUES = 32
"""Fewer say nothing of how often they come."""
_REPEATED, _REGULAR = 3.0, 1.6
"""Samples that a value lasts, at least, and times as long that nine of ten last at most."""
_MANY_STEPS = 4.0
"""Times the smallest step: a sensor that goes on by one step or two is coarse, not slow."""


def without_held_samples(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with the readings of a sensor alone, where its log repeats or joins them; faults.

    A repeat, or a sample on a line, is no measurement at its stamp: a fit takes it for one that comes late.
    """
    arrived, faults = {}, []
    for name in (n for n in MEASURED if n in record):
        channel, at = record[name], ends_of_lines(record[name].y)
        if at is not None:
            kind, rate = "interpolated", channel.rate * len(at) / len(channel)
            detail = f"has straight lines over {len(channel) / len(at):.2g} samples; their ends are used"
        elif name in SENSED and (repeats := repeats_of(channel.y)) > 1:
            at, kind, rate = np.flatnonzero(_is_new(channel.y)), "held_samples", channel.rate / repeats
            detail = f"repeats every value {repeats} times; the first of each is used"
        else:
            continue
        arrived[name] = Channel(channel.t[at], channel.y[at])
        faults.append(Fault(kind, name, 1.0 - len(at) / len(channel), f"the log {detail}", rate, "Hz"))
    return record.with_channels(**arrived), faults


_STRAIGHT, _LINES, _SIZES, _NEARLY_ALL = 0.05, 0.4, 8, (0.9, 0.95)
"""Of the usual bend: less is straight. At least: share of the samples that are so, different sizes of bends
(in as many steps of the usual one), share of what is straight that rises, of lines of about one length."""


def ends_of_lines(values: FloatArray) -> IntArray | None:
    """Return the samples between which a log has lines, as a resampled one has; else None.

    The readings at their ends have noise: bends of many sizes. Those of an encoder at a constant speed, or of
    a motion without noise, have few. Where a line is as long as several, ends that hardly bend lie on it.
    """
    if len(values) < _FEWEST_VALUES or not np.isfinite(values).all():
        return None
    bend = np.abs(np.diff(slope := np.diff(_scale(values))))
    usual = float(np.quantile(bend, 0.95))
    straight, rises = bend < _STRAIGHT * usual, np.abs(slope[1:]) > _STRAIGHT * usual
    if np.count_nonzero(straight) <= _LINES * len(bend) or np.mean(rises[straight]) < _NEARLY_ALL[0]:
        return None
    ends = ~straight & (bend >= np.append(0.0, bend[:-1])) & (bend > np.append(bend[1:], 0.0))
    at = np.concatenate([[0], 1 + np.flatnonzero(ends), [len(values) - 1]])
    length, sizes = np.diff(at) / np.median(np.diff(at)), np.unique(np.rint(_SIZES * bend[~straight] / usual))
    if len(sizes) < _SIZES or np.mean(np.abs(np.log2(length)) <= 1.0) < _NEARLY_ALL[1]:
        return None
    lines = np.where(np.abs(length - np.rint(length)) < 0.1, np.rint(length), 1.0).astype(np.int64)
    each = np.interp(np.arange(lines.sum() + 1), np.append(0, np.cumsum(lines)), at)
    return np.unique(np.rint(each).astype(np.int64))


def repeats_of(values: FloatArray) -> int:
    """Return in how many samples in a row a value arrives, 1 where each is a reading of its own.

    A coarse sensor repeats values too, but as long as the motion has it, and then goes on by a step or two.
    """
    new = np.flatnonzero(_is_new(values))
    if len(new) < _FEWEST_VALUES or not np.isfinite(values).all():
        return 1
    usual, long = np.quantile(np.diff(new), (0.5, 0.9))
    steps = np.abs(np.diff(values[new] / np.max(np.abs(values))))
    regular = usual >= _REPEATED and long < _REGULAR * usual
    return int(usual) if regular and np.median(steps) > _MANY_STEPS * steps.min() else 1


def _is_new(values: FloatArray) -> BoolArray:
    """Return which samples differ from the one before."""
    return np.concatenate([[True], values[1:] != values[:-1]])


NEAR = 0.25
"""Of the shorter period: a torque so close to the stamp of a command is read at its edge."""
INSIDE = 0.6
"""Of the shorter period: how far such a torque moves, past any step of a simulation that ends at the edge and
not past the next one."""
_FEWEST_EDGES = 64
"""Samples at edges, to decide."""
_BETTER = 0.8
"""Of the residual under the command that ended, which that under the command that began must not exceed."""


def behind_the_edge(record: Record) -> tuple[Record, list[Fault]]:
    """Return the record with a motor torque of the commands that begin at its stamps read after their edges.

    A joint in its position loop has no commanded torque, and is returned as it is.
    """
    if not {"command", "motor_torque"} <= set(record.channels) or "reference" in record:
        return record, []
    command, torque = record["command"], record["motor_torque"]
    if len(command) < _FEWEST_EDGES or len(torque) < _FEWEST_EDGES or not _began(command, torque):
        return record, []
    late = INSIDE * min(_period(command), _period(torque))
    fault = Fault("early_torque", "motor_torque", 1.0, "each value is of the command with its stamp")
    return record.with_channels(motor_torque=Channel(torque.t + late, torque.y)), [fault]


def _began(command: Channel, torque: Channel) -> bool:
    """Return whether the torque at the edges of commands is that of the commands that begin there."""
    middle = 0.5 * (command.t[1:] + command.t[:-1])
    begun = np.searchsorted(middle, torque.t)
    near = NEAR * min(_period(command), _period(torque))
    at_edge = (np.abs(torque.t - command.t[begun]) < near) & (begun > 0)
    ended = np.maximum(begun - 1, 0)
    at_edge &= np.isfinite(torque.y) & np.isfinite(command.y[begun]) & np.isfinite(command.y[ended])
    if np.count_nonzero(at_edge) < _FEWEST_EDGES:
        return False
    y, began, was = torque.y[at_edge], command.y[begun[at_edge]], command.y[ended[at_edge]]
    return _rms_left(_scale(y), _scale(began)) < _BETTER * _rms_left(_scale(y), _scale(was))


def _period(channel: Channel) -> float:
    """Return the usual time between two samples, s."""
    return float(np.median(np.diff(channel.t)))


def _scale(values: FloatArray) -> FloatArray:
    """Return values over the largest of them, so that no square overflows."""
    return np.asarray(values / (np.max(np.abs(values)) or 1.0))


def _rms_left(y: FloatArray, u: FloatArray) -> float:
    """Return the RMS that a constant and a gain on the command leave of a torque, in the torque's unit."""
    y, u = y - y.mean(), u - u.mean()
    power = float(u @ u)
    return float(np.sqrt(np.mean((y - (float(u @ y) / power if power else 0.0) * u) ** 2)))
