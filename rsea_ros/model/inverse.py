"""The inverse model: the torques that a measured motion takes.

A drive without a spring drifts freely, so a simulation on its commands runs away from the measurement and
the right model may look worse than the wrong one. The field uses the inverse
dynamic model (Gautier, Janot et al.): filter the measured position both ways, differentiate, and compare
torques, filtered alike:

    T = J q'' + D q' + K q + m g l sin(q) - (torques of the effects)

A spring whose far end something else moves (`motion: measured`: contact, walking, a dynamometer) is in

    T = J q'' + B q' + T_s - (effects at the gear),   T_s = K_s d + b_s d' + (effects at the spring)

with the measured deflection d: T and T_s are compared. Without d the F/T sensor's torque is T_s, and T is.
Where only the commanded torque is known, what acted is what the effects at the command make of it, on a fine
grid and before any filter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.effects import signal_table as st
from rsea_ros.errors import IdentificationError
from rsea_ros.model.equations import Mechanics, gear_inertia, mechanics, with_structure
from rsea_ros.model.extent import SKIPPED_START, check_extent, check_slow
from rsea_ros.model.rig import END_NAMES, Rig, Sensor, check_unfiltered
from rsea_ros.model.simulation import Machine, build
from rsea_ros.model.step import Calls, call_port
from rsea_ros.records.holds import AT_EDGE, PERIODS
from rsea_ros.records.record import BoolArray, Channel, FloatArray, Record

CUT_OFF = 20.0
"""Hz, of the Butterworth filter of fourth order that runs both ways over motion and torque."""

FINE = 5e-4
"""s. Longest step of the grid on which motions are differentiated and torques held."""

FEWEST = 64
"""Samples of a position, from which the filter has settled somewhere in the middle."""


_SIGN = 1e-5
"""rad/s. Along a measured motion the sign of the speed needs no smoothing."""

_ROUNDS = 12
"""In which the motor's torque and what an effect makes of it agree; halves leave 1/4000. Never the measured
torque, by which the model is judged: friction of it took its noise away."""

_COMMAND, _MOTOR, _GEAR, _SPRING, _SENSOR = (int(port) for port in st.Port if port != st.Port.STRUCTURE)


def _nothing() -> FloatArray:
    return np.empty(0)


@dataclass(frozen=True)
class Motion:
    """A measured motion on a uniform grid, filtered: t (s), q (rad), v (rad/s), a (rad/s^2), torque (N m).

    counts: where the filter has settled, outside the gaps of the record, shape of t. command: N m, held over
    each of several parts of a sample; empty where the torque was measured. Of a rig whose output is moved:
    ft, torque of the F/T sensor (N m); d, d_rate, the spring's deflection (rad, rad/s); empty where not
    measured. white: RMS of the noise of each channel, before the filter, in its unit. corner: Hz, above which
    the noise of the position hides torques. parts: of the samples, between gaps.
    """

    t: FloatArray
    q: FloatArray
    v: FloatArray
    a: FloatArray
    torque: FloatArray
    counts: BoolArray
    command: FloatArray = field(default_factory=_nothing)
    ft: FloatArray = field(default_factory=_nothing)
    d: FloatArray = field(default_factory=_nothing)
    d_rate: FloatArray = field(default_factory=_nothing)
    white: Mapping[str, float] = field(default_factory=dict)
    corner: float = math.inf
    parts: tuple[slice, ...] = (slice(None),)

    @property
    def judged(self) -> dict[str, FloatArray]:
        """The measured torques that a model is compared with, N m; the F/T sensor's where d is known."""
        ft = {"ft": self.ft} if len(self.ft) and len(self.d) else {}
        return {"motor_torque": self.compared(self.torque), **ft}

    def compared(self, torque: FloatArray) -> FloatArray:
        """Return a motor torque as it is compared: at each frequency in units of the position's noise there.

        Of an inertia the noise rises with the square of the frequency, and would hide what is slow.
        """
        period, torque = float(self.t[1] - self.t[0]), torque.copy()
        for part in self.parts:
            torque[part] = smooth(torque[part], period, self.corner, 1)
        return torque

    def with_noise(self, rig: Rig, white: Mapping[str, float]) -> Motion:
        """Return the motion with the noise of its channels; a rig's inertia makes the corner of it."""
        level = max(white.get("motor_torque", 0.0), _TORQUE_TRUST * float(np.std(self.torque)))
        inertia = float(_as_one_part(rig)[1].mass[0, 0])
        corner = math.sqrt(level / max(inertia * white["position"], 1e-300)) / (2.0 * math.pi)
        return replace(self, white=white, corner=max(corner, _SLOWEST) if corner < CUT_OFF else math.inf)


_SLOWEST = 4.0
"""Hz. A lower corner would remember longer than half a block of a quarter of a second, judged by itself."""
_TORQUE_TRUST = 0.01
"""Of a torque's RMS: a smaller error of the slow torque is not worth the fast ones."""


def is_inverse(rig: Rig) -> bool:
    """Return whether a rig is compared by torque: nothing that it has holds it, so that it drifts."""
    drifts = rig.rigid_spring and rig.motion != "simulated"
    return (drifts or rig.motion == "measured") and rig.loop is None


def spring_mode(rig: Rig) -> float:
    """Return the frequency at which rotor and load of a free output swing against each other, Hz."""
    inertias = gear_inertia(rig) + rig["chassis.inertia"], rig["spring_end.inertia"]
    return math.sqrt(rig["spring.stiffness"] * sum(1.0 / inertia for inertia in inertias)) / (2.0 * math.pi)


def as_seen(rig: Rig, records: Sequence[Record]) -> tuple[Rig, tuple[float, ...]]:
    """Return a rig with a rigid spring where the output drifts freely and no record can show the spring.

    Then also the spring's mode and the highest rate of the records, Hz.

    Its mode lies above the rate at which all were sampled, and neither deflection nor F/T was measured. Rotor
    and load turn as one; a simulation from commands alone would run away, the torque along the motion tells.
    """
    drifts = rig.clamped == frozenset({"housing_end"}) and not rig["spring_end.stiffness"]
    is_plain = not rig.rigid_spring and rig.loop is None and not rig.motion and not rig.conditions
    is_blind = all("position" in r and not {"deflection", "ft"} & r.channels.keys() for r in records)
    if not (drifts and is_plain and is_blind):
        return rig, ()
    mode, rate = spring_mode(rig), max(c.rate for r in records for c in r.channels.values() if len(c) > 1)
    if mode < rate:
        return rig, ()
    kept = {n: q for n, q in rig.quantities.items() if not n.startswith("spring.")}
    return replace(rig, quantities=kept, rigid_spring=True), (mode, rate)


def require_position(record: Record) -> None:
    """Raise IdentificationError for a record without a position."""
    if "position" not in record:
        raise IdentificationError(
            f"{record.source}: no position channel, expected one: "
            "a rig without a spring is judged by its motion"
        )


def motion_from(record: Record, rig: Rig | None = None) -> Motion:
    """Return the filtered motion and the torque that acted. Raises IdentificationError without a position.

    rig: of one whose output is moved, what its spring shows, too: without deflection and F/T nothing does.
    Each side of a gap is filtered by itself, and a gap has a straight line.
    """
    require_position(record)
    from scipy.interpolate import CubicSpline  # with its like in `smoothed`, 0.4 s that a spring saves

    beside = [n for n in ("deflection", "ft") if rig is not None and rig.motion == "measured" and n in record]
    if rig is not None and rig.motion == "measured" and not beside:
        raise IdentificationError(
            f"{record.source}: no deflection or ft channel, expected one: {rig.name} is moved from outside"
        )
    used = {"command", "position", "motor_torque", *beside}
    record = _finite(replace(record, channels={n: c for n, c in record.channels.items() if n in used}))
    position = record["position"]
    if len(position) < FEWEST:
        raise IdentificationError(
            f"{record.source}: position has {len(position)} samples, expected at least {FEWEST}"
        )
    check_extent(record, float(position.t[0]), record.stop)
    check_slow(record)
    period = 1.0 / position.rate
    finer = max(1, math.ceil(period / FINE))
    step = period / finer
    t = np.arange(position.t[0], position.t[-1] + 0.5 * step, step)
    q, torques = np.interp(t, position.t, position.y), _possible_torques(record, t, bool(beside))
    v, a = np.zeros(len(t)), np.zeros(len(t))
    counts, shown, parts = np.zeros(len(t), bool), {n: np.zeros(len(t)) for n in beside}, []
    for begin, end in _sampled_spans(record, float(t[0]), float(t[-1])):
        part = slice(*np.searchsorted(t, [begin - 0.5 * step, end + 0.5 * step]))
        parts.append(slice(math.ceil(part.start / finer), math.ceil(part.stop / finer)))
        known = position.between(begin, end + 0.5 * step)
        q[part] = smooth(CubicSpline(known.t, known.y)(t[part]), step)
        v[part] = np.gradient(q[part], step)
        a[part] = np.gradient(v[part], step)
        for torque in torques:
            torque[part] = smooth(torque[part], step)
        for n, values in shown.items():
            one = record[n].between(begin, end + 0.5 * step)
            values[part] = smooth(CubicSpline(one.t, one.y)(t[part]), step)
        counts[part] = (t[part] >= t[part][0] + SKIPPED_START) & (t[part] <= t[part][-1] - SKIPPED_START)
    fine = t
    t, q, v, a, *torques = (np.asarray(values[::finer], np.float64) for values in (t, q, v, a, *torques))
    rate = np.gradient(shown["deflection"], step) if "deflection" in shown else _nothing()
    ft, d = (np.asarray(shown.get(n, _nothing())[::finer], np.float64) for n in ("ft", "deflection"))
    command = _nothing() if "motor_torque" in record else record["command"].held(fine + 0.5 * step)
    counts = counts[::finer]
    noise = rig.sensors.get("position", Sensor()).level if rig is not None else 0.0
    moves = counts & ~_at_rest(np.interp(t, position.t, position.y), noise, period)
    counts = moves if np.count_nonzero(moves) >= FEWEST else counts
    torque = _likeliest(torques, [a, v, np.sign(v), np.ones(len(t)), ft if len(ft) else d], counts)
    return Motion(t, q, v, a, torque, counts, command, ft, d, np.asarray(rate[::finer]), parts=tuple(parts))


def _possible_torques(record: Record, t: FloatArray, is_moved: bool) -> list[FloatArray]:
    """Return the torque that acted at instants; of a moved output also as it is where nothing is held.

    A loop far faster than its log holds no command from row to row: the measured torque counts at an instant
    from its stamps back to a sample before, where the checks moved it towards the end of a hold.
    """
    torque = record["motor_torque"] if is_moved and "motor_torque" in record else None
    held = [_torque_at(record, t)]
    if torque is None:
        return held
    earlier = np.linspace(0.0, 1.0, _INSTANTS) / torque.rate
    return held + [np.interp(t, torque.t - early, torque.y) for early in earlier]


def _likeliest(
    torques: Sequence[FloatArray], columns: Sequence[FloatArray], counts: BoolArray
) -> FloatArray:
    """Return the first of some torques, or another one that a motion explains far better, by regression."""
    if len(torques) == 1 or np.count_nonzero(counts) < FEWEST:
        return torques[0]
    rows = np.column_stack(columns)[counts]
    left = [y[counts] - rows @ np.linalg.lstsq(rows, y[counts], rcond=None)[0] for y in torques]
    power = [float(np.mean(r**2)) for r in left]
    best = int(np.argmin(power))
    return torques[best if power[best] < _FAR_BETTER * power[0] else 0]


_INSTANTS, _FAR_BETTER = 9, 0.5
"""Tried within a sample. Of the power that is left: a torque whose hold is not the log's leaves far more."""


def _at_rest(position: FloatArray, noise: float, period: float) -> BoolArray:
    """Return where a gear stands still as far as its encoder tells, or did so within the filter's reach.

    Any torque below its friction holds it there, which no law of the speed says. position: rad, not filtered.
    """
    from scipy.ndimage import binary_dilation, maximum_filter1d, minimum_filter1d

    width = 2 * round(1.0 / (CUT_OFF * period)) + 1
    travel = maximum_filter1d(position, width) - minimum_filter1d(position, width)
    return np.asarray(binary_dilation(travel <= _RANGE * noise, np.ones(width, bool)), bool)


_RANGE = 6.0
"""Sigmas between the highest and the lowest of a hundred readings of one angle."""
_FILTERED = ("position", "motor_torque", "deflection", "ft")
_BRIDGED = 0.1
"""s. A shorter silence of a motion is a line, and counts."""


def _sampled_spans(record: Record, start: float, stop: float) -> list[tuple[float, float]]:
    """Return begin and end (s) of the parts between gaps of the motion or its torque; short ones are gaps."""
    lost: list[tuple[float, float]] = []
    for t in (c.t for n, c in record.channels.items() if n in _FILTERED):
        first, last = float(t[0]), float(t[-1])  # a channel that begins late, or ends early
        silent = np.flatnonzero(np.diff(t) > max(_BRIDGED, PERIODS * float(np.median(np.diff(t)))))
        lost += zip(t[silent].tolist(), t[silent + 1].tolist(), strict=True)
        lost += [(start, first)] * (first > start + SKIPPED_START)
        lost += [(last, stop)] * (last < stop - SKIPPED_START)
    lost.sort()
    ends, begins = [*(a for a, _ in lost), stop], [start, *(b for _, b in lost)]
    parts = [(max(begins[: k + 1]), min(ends[k:])) for k in range(len(ends))]
    return [(begin, end) for begin, end in parts if end - begin > 2.0 * SKIPPED_START] or [(start, stop)]


def _finite(record: Record) -> Record:
    """Return the record without the samples of motion and torque that are NaN: one spoils a filter."""
    kept = {n: (c, np.isfinite(c.y)) for n, c in record.channels.items() if n in _FILTERED}
    held = {n: Channel(c.t[good], c.y[good]) for n, (c, good) in kept.items() if not good.all()}
    empty = {n for n, c in held.items() if not len(c)} - {"position"}
    return replace(record, channels={n: c for n, c in {**record.channels, **held}.items() if n not in empty})


def acting_torque(record: Record) -> Channel:
    """Return the motor torque that acted: measured, or as commanded where it was not."""
    return record["motor_torque" if "motor_torque" in record else "command"]


def _torque_at(record: Record, t: FloatArray) -> FloatArray:
    """Return the motor torque that acted at instants.

    A command is held from its stamp on. A measured torque that shows the command before its stamp was taken
    at the end of a hold, and counts for the whole hold; any other counts at its stamp. At the edge between
    two holds their mean counts: with either of them the torque is half a sample early or late.
    """
    command = record["command"]
    edge = AT_EDGE / command.rate
    holds = np.array([np.searchsorted(command.t, t + side * edge) - 1 for side in (-1.0, 1.0)])
    if "motor_torque" not in record:
        return np.asarray(command.y[np.maximum(holds, 0)].mean(axis=0), np.float64)
    torque = record["motor_torque"]
    ended, begun = (np.searchsorted(command.t, torque.t + side * edge) - 1 for side in (-1.0, 1.0))
    off = [float(np.std(torque.y - command.y[np.maximum(k, 0)])) for k in (ended, begun)]
    if off[1] <= off[0]:
        return np.interp(t, torque.t, torque.y)
    shown = np.searchsorted(ended, holds, side="left")
    return np.asarray(torque.y[np.minimum(shown, len(torque) - 1)].mean(axis=0), np.float64)


def smooth(values: FloatArray, period: float, corner: float = CUT_OFF, order: int = 4) -> FloatArray:
    """Return values behind a Butterworth filter (Hz), run both ways. period: s, between samples."""
    from scipy.signal import filtfilt

    if math.isinf(corner):
        return values
    return np.asarray(filtfilt(*_butterworth(order, min(corner * 2.0 * period, 0.8)), values))


@lru_cache(maxsize=64)  # each takes half as long as filtering a record, and a fit asks for it again and again
def _butterworth(order: int, corner: float) -> tuple[FloatArray, ...]:
    from scipy.signal import butter

    return tuple(butter(order, corner))


def noise_along(rig: Rig, motion: Motion) -> dict[str, float]:
    """Return the RMS of what the noise of all channels leaves between the torques of `motion.judged`, N m.

    A position's noise passes the filter, is differentiated twice, and becomes torque by the rig's inertia.
    """
    period = float(motion.t[1] - motion.t[0])
    h = filtered_noise(period)
    slow = smooth(h, period, motion.corner, 1)
    white = {n: motion.white.get(n, 0.0) for n in _FILTERED}
    own = {n: white[n] * math.hypot(*x[0]) for n, x in (("motor_torque", slow), ("ft", h))}
    load = {"motor_torque": 0.0, "ft": 0.0}
    m = _as_one_part(rig)[1]
    mass, damping, stiffness = (float(x[0, 0]) for x in (m.mass, m.damping, m.stiffness))
    if rig.motion == "measured":
        damping, stiffness = damping - rig["spring.damping"], 0.0
        d = np.array([rig["spring.stiffness"], rig["spring.damping"], 0.0]) * white["deflection"]
        d = d if len(motion.d) else np.array([white["ft"], 0.0, 0.0])
        load = {"motor_torque": math.hypot(*(d @ slow)), "ft": math.hypot(*(d @ h))}
    moving = np.array([stiffness, damping, mass]) @ slow
    moved = {"motor_torque": white["position"] * math.hypot(*moving), "ft": 0.0}
    return {n: math.hypot(own[n], load[n], moved[n]) for n in motion.judged}


@lru_cache(maxsize=16)
def filtered_noise(period: float) -> FloatArray:
    """Return what one sample of an angle leaves of itself, its rate and its acceleration, shape (3, n).

    At the samples around it; all is linear, so white noise of one sigma leaves the root of the squares' sum.
    period: s, between samples.
    """
    from scipy.interpolate import CubicSpline

    reach = max(FEWEST, math.ceil(SKIPPED_START / period))
    finer = max(1, math.ceil(period / FINE))
    one = np.eye(1, 2 * reach + 1, reach)[0]
    at = np.arange(len(one)) * period
    step = period / finer
    q = smooth(CubicSpline(at, one)(np.arange(2 * reach * finer + 1) * step), step)
    v = np.gradient(q, step)
    return np.array([q, v, np.gradient(v, step)])[:, ::finer]


def torques_along(rig: Rig, motion: Motion) -> dict[str, FloatArray]:
    """Return the torques of `motion.judged` that a motion takes, N m, filtered like the motion."""
    read = ("position", "motor_torque", *(("ft", "deflection") if rig.motion == "measured" else ()))
    check_unfiltered(rig, read, "a rig that is judged along its measured motion")
    rig_as_is, m = _as_one_part(rig)
    if m.order != 1 or "housing_end" not in rig.clamped:
        raise IdentificationError(
            f"rig {rig.name}: {m.order} moving parts, expected one on a clamped housing for the inverse model"
        )
    period = float(motion.t[1] - motion.t[0])
    machine = build(rig, period, float(motion.t[-1] - motion.t[0]))
    motion = _as_moved(machine, motion, period)
    if rig.motion == "measured":
        return _beside_spring(rig_as_is, m, machine, motion, period)
    gravity = rig_as_is["spring_end.gravity"] * np.sin(motion.q + rig_as_is["spring_end.gravity_angle"])
    linear = m.mass[0, 0] * motion.a + m.damping[0, 0] * motion.v + m.stiffness[0, 0] * motion.q
    load = gravity + rig_as_is["spring_end.damping"] * motion.v + rig_as_is["spring_end.stiffness"] * motion.q
    nothing = np.zeros(len(motion.t))
    needed = _needed(machine, motion, linear, gravity, load, nothing, nothing, period)[0]
    return {"motor_torque": motion.compared(needed + _lost_of_command(rig, machine, motion))}


def _as_one_part(rig: Rig) -> tuple[Rig, Mechanics]:
    """Return the rig whose motion is judged, and its equations without gravity; a moved output is held."""
    rig = with_structure(rig)
    if rig.motion == "measured":
        rig = replace(rig, clamped=frozenset(END_NAMES))
    return rig, mechanics(rig, linear_gravity=False)


def _beside_spring(
    rig: Rig, m: Mechanics, machine: Machine, motion: Motion, period: float
) -> dict[str, FloatArray]:
    """Return the torques of a motor and its spring along their measured motions."""
    nothing = np.zeros(len(motion.t))
    d, rate = (motion.d, motion.d_rate) if len(motion.d) else (nothing, nothing)
    load = rig["spring.stiffness"] * d + rig["spring.damping"] * rate if len(motion.d) else motion.ft
    if len(motion.d) and len(motion.ft) and rig.zero_unknown("deflection"):
        load = load + float(np.mean((motion.ft - load)[motion.counts])) if motion.counts.any() else load
    damping = m.damping[0, 0] - rig["spring.damping"]
    linear = m.mass[0, 0] * motion.a + damping * motion.v + load
    torque, shown = _needed(machine, motion, linear, nothing, load, d, rate, period)
    torque = torque + _lost_of_command(rig, machine, motion)
    found = {"motor_torque": motion.compared(torque), "ft": load + smooth(shown - load, period)}
    return {n: found[n] for n in motion.judged}


def _needed(
    machine: Machine, motion: Motion, linear: FloatArray, gravity: FloatArray, load: FloatArray,
    d: FloatArray, d_rate: FloatArray, period: float,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return the motor's torque and the F/T sensor's, found in rounds: some effects depend on the former."""
    gains = motor_gains(*_parts(machine), len(motion.t))
    needed, added = (linear + smooth(gravity, period)) / gains, np.zeros(len(motion.t))
    for _ in range(_ROUNDS):
        before = added
        added, shown = _effect_torques(*_parts(machine), motion.q, motion.v, needed, load, d, d_rate)
        if np.array_equal(before, added):
            break
        needed = (linear + smooth(gravity - added, period)) / gains
    return needed, shown


def _parts(machine: Machine) -> tuple[Calls, FloatArray, FloatArray]:
    """Return calls, table and states for a walk along a motion, nothing remembered."""
    machine.effect_x[:] = 0.0
    return machine.calls, machine.table, machine.effect_x


def _as_moved(machine: Machine, motion: Motion, period: float) -> Motion:
    """Return a motion without the errors that effects of the encoder added."""
    if machine.calls.first[_SENSOR] == machine.calls.first[_SENSOR + 1]:
        return motion
    error = smooth(_sensor_errors(*_parts(machine), motion.q), period)
    v = np.gradient(error, period)
    return replace(motion, q=motion.q - error, v=motion.v - v, a=motion.a - np.gradient(v, period))


def _lost_of_command(rig: Rig, machine: Machine, motion: Motion) -> FloatArray:
    """Return what the effects at the command take away from it, N m, filtered like the motion.

    Added to the torque that a motion takes it is the command that the motion takes.
    """
    if not len(motion.command) or machine.calls.first[_COMMAND] == machine.calls.first[_COMMAND + 1]:
        return np.zeros(len(motion.t))
    period = float(motion.t[1] - motion.t[0])
    finer = round(len(motion.command) / len(motion.t))
    fine = build(rig, period / finer, float(motion.t[-1] - motion.t[0]))
    t = motion.t[0] + (np.arange(len(motion.command)) + 0.5) * period / finer
    v = np.interp(t, motion.t, motion.v)
    lost = motion.command - _command_torque(*_parts(fine), motion.command, v)
    return np.interp(motion.t, t, smooth(lost, period / finer))


@njit(cache=True, error_model="numpy")
def motor_gains(calls, s, effect_x, count):  # type: ignore[no-untyped-def]
    """Return the gain of the effects at the motor, for a torque of 1 N m, at each sample."""
    gains = np.empty(count)
    for k in range(count):
        s[st.TIME], s[st.COMMAND] = k * s[st.STEP], 1.0
        call_port(_MOTOR, calls, s.ctypes.data, calls.p.ctypes.data, effect_x.ctypes.data)
        gains[k] = s[st.COMMAND]
    return gains


@njit(cache=True, error_model="numpy")
def _command_torque(calls, s, effect_x, command, v):  # type: ignore[no-untyped-def]
    """Return the mean torque (N m) over each step after the effects at the command, along a motion."""
    torque = np.empty(len(command))
    for k in range(len(command)):
        s[st.TIME], s[st.OUTPUT_VELOCITY] = k * s[st.STEP], v[k]
        s[st.COMMAND] = s[st.CURRENT] = s[st.CURRENT_BEFORE] = s[st.HELD] = command[k]
        s[st.BEFORE] = s[st.AFTER] = 0.0
        call_port(_COMMAND, calls, s.ctypes.data, calls.p.ctypes.data, effect_x.ctypes.data)
        torque[k] = s[st.COMMAND]
    return torque


@njit(cache=True, error_model="numpy")
def _sensor_errors(calls, s, effect_x, q):  # type: ignore[no-untyped-def]
    """Return the angle (rad) that effects at the sensors add to the encoder's, along a motion."""
    errors = np.empty(len(q))
    for k in range(len(q)):
        s[st.TIME] = k * s[st.STEP]
        s[st.POSITION] = s[st.OUTPUT_ANGLE] = q[k]
        call_port(_SENSOR, calls, s.ctypes.data, calls.p.ctypes.data, effect_x.ctypes.data)
        errors[k] = s[st.POSITION] - q[k]
    return errors


@njit(cache=True, error_model="numpy")
def _effect_torques(calls, s, effect_x, q, v, torque, load, d, d_rate):  # type: ignore[no-untyped-def]
    """Return the torque (N m) that the effects add at the gear along a motion, less what they add in the
    spring, and the torque that the F/T sensor shows."""
    added, shown = np.empty(len(q)), np.empty(len(q))
    s[st.MOBILITY] = s[st.GEAR_VELOCITY_SPAN] = s[st.DEFLECTION_SPAN] = 0.0
    s[st.CREEP] = _SIGN
    for k in range(len(q)):
        s[st.TIME], s[st.COMMAND] = k * s[st.STEP], torque[k]
        s[st.GEAR_ANGLE], s[st.GEAR_VELOCITY], s[st.ROTOR_ANGLE] = q[k], v[k], s[st.TURNS] * q[k]
        s[st.DEFLECTION], s[st.DEFLECTION_RATE] = d[k], d_rate[k]
        s[st.SPRING_TORQUE] = s[st.GEAR_TORQUE] = 0.0
        call_port(_SPRING, calls, s.ctypes.data, calls.p.ctypes.data, effect_x.ctypes.data)
        s[st.LOAD] = s[st.FT] = load[k] + s[st.SPRING_TORQUE]
        call_port(_GEAR, calls, s.ctypes.data, calls.p.ctypes.data, effect_x.ctypes.data)
        added[k] = s[st.GEAR_TORQUE] - s[st.SPRING_TORQUE]
        s[st.POSITION] = s[st.OUTPUT_ANGLE] = q[k]
        call_port(_SENSOR, calls, s.ctypes.data, calls.p.ctypes.data, effect_x.ctypes.data)
        shown[k] = s[st.FT]
    return added, shown
