"""Simulation of a rig with its effects: whole records, with and without the noise of the sensors.

Fixed step, deterministic. The same compiled step (step.py) serves the plant, one sample at a time.
"""

import itertools
import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from rsea_ros.compiler import njit
from rsea_ros.effects import signal_table as st
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.effect import Effect
from rsea_ros.errors import RigError
from rsea_ros.model import drive as driven
from rsea_ros.model.drive import Drive
from rsea_ros.model.equations import Mechanics, mechanics, train_ratio, with_structure
from rsea_ros.model.extent import LARGEST, SMALLEST
from rsea_ros.model.position_loop import STATES, control, loop_parameters, with_command
from rsea_ros.model.propagator import OUTPUT_ROWS, propagator, start_map
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.sensor_filter import Running
from rsea_ros.model.step import OUTPUTS, Calls, Linear, StepInputs, StepState, advance
from rsea_ros.records.record import Channel, FloatArray, Record


@njit(cache=True, nogil=True)
def _sample_smooth(values, at, command):  # type: ignore[no-untyped-def]
    """Interpolate values at steps 0, 1, 2, … at fractional steps, by cubics through four points.

    Where the command jumps a velocity has a kink: the points are taken from one side of it, and are fewer
    where a jump is not on the grid.
    """
    out, last = np.empty(len(at)), len(values) - 1
    for i in range(len(at)):
        u = min(max(at[i], 0.0), float(last))
        k = int(u)
        if u == k:
            out[i] = values[k]
            continue
        left, right = k, k + 1
        if left > 0 and command[left - 1] == command[k]:
            left -= 1
        while right < last and right - left < 3 and command[right] == command[k]:
            right += 1
        while left > 0 and right - left < 3 and command[left - 1] == command[k]:
            left -= 1
        out[i] = _newton(values, left, right, u - left)
    return out


@njit(cache=True, nogil=True)
def _newton(v, left, right, u):  # type: ignore[no-untyped-def]
    """Return Newton's polynomial through the two to four values from left to right, u steps after left."""
    value = v[left] + u * (v[left + 1] - v[left])
    if right - left > 1:
        value += u * (u - 1) / 2 * (v[left + 2] - 2 * v[left + 1] + v[left])
    if right - left > 2:
        value += u * (u - 1) * (u - 2) / 6 * (v[left + 3] - 3 * (v[left + 2] - v[left + 1]) - v[left])
    return value


@njit(cache=True, nogil=True)
def _sample_current(values, at, within, early, lags):  # type: ignore[no-untyped-def]
    """Return what was held `early` steps before each instant: a hold that just ended counts.

    within: of each step, see _beside_mean; empty where no command changes within one. lags: nothing is held;
    the current goes straight until the command changes, and straight on.
    """
    out, last = np.empty(len(at)), len(values) - 2
    for i in range(len(at)):
        back = min(max(at[i] - (0.0 if lags else early), 0.0), last + 1.0)
        k = min(int(back), last)
        begin, end, since, span = values[k], values[k + 1], back - k, 1.0
        if k < len(within) and within[k, 1] != within[k, 2]:
            span = within[k, 2] / (within[k, 2] - within[k, 1])
            if since < span:
                end = within[k, 3]
            else:
                begin, since, span = within[k, 3], since - span, 1.0 - span
        out[i] = begin + since / span * (end - begin) if lags else end
    return out


@njit(cache=True, nogil=True)
def _beside_mean(within, at):  # type: ignore[no-untyped-def]
    """Return the integral of what is held beyond its mean from the begin of a step on, at instants in steps.

    within: HELD, BEFORE, AFTER, CURRENT_BEFORE of each step, N m (model/step.py).
    """
    out = np.zeros(len(at))
    for i in range(len(at)):
        k = int(max(at[i], 0.0))
        if k < len(within) and within[k, 1] != within[k, 2]:
            before, after = within[k, 1], within[k, 2]
            passed, share = at[i] - k, after / (after - before)
            out[i] = before * min(passed, share) + after * max(passed - share, 0.0)
    return out


NOTHING_WITHIN, NOTHING_HELD = np.empty((0, 4)), np.empty(0)


def sample(
    name: str, values: FloatArray, at: FloatArray, held: FloatArray, within: FloatArray = NOTHING_WITHIN, *,
    early: float = 0.5, lags: bool = False,
) -> FloatArray:  # fmt: skip
    """Return a simulated channel at instants in steps since the start.

    values: at the ends of the steps, the initial one first, shape (steps + 1,). held: what is held in each
    step and jumps, 0 where nothing does. within: see _beside_mean, or nothing. early, lags: of the current,
    see _sample_current: a row's current is that of the command before, but for one that comes late.
    """
    if name == "motor_torque":
        return np.asarray(_sample_current(values, at, within, early, lags))
    return np.asarray(_sample_smooth(values, at, held))


SLOW = 0.1
"""s over which an angle's noise is averaged: a simulation on the measured angle is right for so long."""
_AFTER_DELAY = 1
"""Order of a position loop at its port: its targets come late, and what it asks is limited and lags."""
_SENSORS = 1
"""Stream of the random numbers of sensor noise."""


@dataclass(frozen=True)
class Machine:
    """A rig made ready for the step, with state for it to change. lags, early: see _sample_current."""

    linear: Linear
    calls: Calls
    x: FloatArray
    table: FloatArray
    effect_x: FloatArray
    mechanics: Mechanics
    lags: bool
    early: float
    start_maps: dict[str, FloatArray]

    def begin(
        self,
        initial: tuple[float, float] | driven.SpringStart | driven.LoadStart = (0.0, 0.0),
        spring: driven.SpringStart | None = None,
    ) -> None:
        """Set the state to an output angle (rad) and velocity (rad/s), at time zero, with no history.

        spring: what its sensor shows at that time, where it is known; as `initial`, all that is known.
        """
        if isinstance(initial, driven.LoadStart):
            spring, initial = initial.spring, (initial.position, initial.velocity)
        if isinstance(initial, driven.SpringStart):
            rows = self.linear.outputs
            shown = start_map(self.mechanics, rows[OUTPUT_ROWS.index(initial.channel)])
            self.x[:] = shown @ np.array([initial.value, initial.rate])
            initial = float(rows[0] @ self.x), float(rows[1] @ self.x)
        elif spring is None:
            self.x[:] = self._start_map() @ np.array(initial)
        else:
            self.x[:] = self._start_map(spring.channel) @ np.array([*initial, spring.value, spring.rate])
        self.effect_x[:] = 0.0
        self.table[st.FIRST_READ : st.VELOCITY + 1] = 0.0
        self.table[st.POSITION] = self.table[st.OUTPUT_ANGLE] = initial[0]
        self.table[st.VELOCITY] = self.table[st.OUTPUT_VELOCITY] = initial[1]
        self.table[st.FT] = self.linear.outputs[2] @ self.x
        self.table[st.PLAY], self.table[st.SPRING_ANGLE] = 0.0, self.linear.outputs[3] @ self.x

    def _start_map(self, channel: str = "") -> FloatArray:
        if channel not in self.start_maps:
            rows = self.linear.outputs
            spring = rows[OUTPUT_ROWS.index(channel)] if channel else None
            self.start_maps[channel] = start_map(self.mechanics, rows[0], spring)
        return self.start_maps[channel]


def simulate(rig: Rig, record: Record, *, refine: int = 1) -> dict[str, FloatArray]:
    """Return the channels that a noise-free bench would have measured, each at its own stamps.

    The record's `command` drives it, held at its stamps; with `rig.controller` and a `reference` channel, or
    with a rig that positions command, the loop is closed in the simulation. refine divides the fixed step.
    """
    return simulate_drive(rig, drive_of(record, rig, refine=refine))


def drive_of(record: Record, rig: Rig, *, refine: int = 1) -> Drive:
    """Return the drive of a rig from a record. Raises ChannelError where its commands are missing."""
    return driven.drive_from(
        with_command(record, rig), refine=refine,
        closed_loop=rig.loop is None and rig.controller is not None and "reference" in record,
        from_rest="position" in record and driven.zero_unknown(record, rig, "position"),
        targeted=rig.loop is not None, hold=rig.hold,
    )


def simulate_drive(rig: Rig, drive: Drive) -> dict[str, FloatArray]:
    """Return each channel of a drive at its sampling instants."""
    return simulate_drives(rig, (drive,))[0][0]


def simulate_drives(
    rig: Rig, drives: Sequence[Drive], at: Sequence[Sequence[Mapping[str, FloatArray]]] = (), *,
    on_angle: bool = False,
) -> list[list[dict[str, FloatArray]]]:  # fmt: skip
    """Return the channels of several drives of one rig, prepared once, and simulated once for all readings.

    at: for each drive the instants of its readings; without, its own are the only ones. on_angle: effects of
    the rotor's angle act along the measured one, less its noise by a first simulation along it.
    """
    machines: dict[tuple[float, float, bool], Machine] = {}
    results = []
    for drive, readings in zip(drives, at or [[drive.at] for drive in drives], strict=True):
        kind = (drive.step, drive.drift_time, len(drive.reference) > 0 or rig.loop is not None)
        if kind not in machines:
            machines[kind] = build(rig, kind[0], kind[1], in_loop=kind[2])
        results.append(_drive_outputs(machines[kind], rig, drive, readings, on_angle))
    return results


def _drive_outputs(
    machine: Machine, rig: Rig, drive: Drive, readings: Sequence[Mapping[str, FloatArray]], on_angle: bool
) -> list[dict[str, FloatArray]]:
    """Return the channels of a drive at the instants of each reading, from its own beginning."""
    ridden = _middles(drive.angle) * rig["gear.ratio"] if on_angle else np.empty(0)
    channels = {n: OUTPUTS.index(n) for n in drive.at if rig.measures(n)}
    wanted = [{n: _instants(rig, drive, n, at[n]) for n in channels} for at in readings]
    results = [{n: np.empty(len(at[n])) for n in channels} for at in wanted]
    spans = drive.simulated
    edges = [0.5 * (end + first) for (_, end), (first, _) in itertools.pairwise(spans)]
    is_mixed = machine.lags or machine.early < 0.5 or drive.mixes
    filters = rig.filters()
    for part, (first, end) in enumerate(spans):
        held = drive.command[first:end] if drive.jumps else np.zeros(end - first)
        within = np.zeros((end - first, 4)) if is_mixed else NOTHING_WITHIN
        if len(within):
            within[:, 0] = held
            held = within[:, 0]
        out = over_span(machine, rig, drive, ridden, within, first, end)
        if on_angle:
            steady = _without_noise(drive, out[1:, 0], first, end) * rig["gear.ratio"]
            out = over_span(machine, rig, drive, steady, within, first, end)
        begins = [0, *(k - first for k, _ in drive.restarts if first < k < end)]
        for at, sampled in zip(wanted, results, strict=True):
            for n, k in channels.items():
                inside = np.searchsorted(edges, at[n]) == part if edges else slice(None)
                since = at[n][inside] - first
                known = filters.get(n)
                name = n if known is None or known.is_sampled else ""  # what has passed before does not jump
                read = sample(name, out[:, k], since, held, within, early=machine.early, lags=machine.lags)
                if len(within) and name and (kick := _kick(machine, n)) != 0.0:
                    read += kick * drive.step * _beside_mean(within, since)
                if name and known is not None and len(read) > 1:
                    period = drive.step * float(np.median(np.diff(at[n])))
                    read = known.over(read, period, [0, *np.searchsorted(since, begins[1:])])
                sampled[n][inside] = read
    return results


def _without_noise(drive: Drive, simulated: FloatArray, first: int, end: int) -> FloatArray:
    """Return the measured angle at the middle of each step, what is faster than SLOW as simulated, rad."""
    from scipy.ndimage import uniform_filter1d

    angle = drive.angle.copy()
    off = uniform_filter1d(angle[first:end] - simulated, max(1, round(SLOW / drive.step)), mode="nearest")
    angle[first:end] = simulated + off
    return _middles(angle)


def over_span(
    machine: Machine, rig: Rig, drive: Drive, ridden: FloatArray, within: FloatArray, first: int, end: int
) -> FloatArray:
    """Return OUTPUTS at the ends of the steps of a span, those at its beginning first. within: StepInputs."""
    out = np.empty((end - first + 1, len(OUTPUTS)))
    torque, reference = drive.command, drive.reference
    if rig.loop is not None:
        torque, reference = np.zeros(len(drive.command)), drive.command
    anew = [r for r in drive.restarts if r[0] > 0 and first <= r[0] < end]
    begins = [*([(first, drive.initial)] if first == 0 else []), *anew]
    ends = [*(k for k, _ in begins[1:]), end]
    state = StepState(machine.x, machine.table, machine.effect_x)
    for (k, initial), stop in zip(begins, ends, strict=True):
        machine.begin(initial, drive.spring if k == 0 else None)
        start = k - first
        out[start] = machine.table[[st.POSITION, st.VELOCITY, st.COMMAND, st.FT, st.SPRING_ANGLE]]
        inputs = StepInputs(
            torque[k:stop], reference[k:stop], ridden[k:stop], drive.origin + k * drive.step,
            drive.jumps, within[start : stop - first],
        )  # fmt: skip
        part = out[start : stop - first + 1]
        advance(machine.linear, machine.calls, inputs, state, part[1:])
        part[0, 2] = part[1, 2]
        _pass_filters(machine, rig, part, inputs.within)
    return out


def _pass_filters(machine: Machine, rig: Rig, out: FloatArray, within: FloatArray) -> None:
    """Let OUTPUTS at the ends of steps, those at the beginning first, pass the filters in continuous time."""
    for n in (n for n, known in rig.filters().items() if not known.is_sampled):
        values, held = out[:, OUTPUTS.index(n)], n == "motor_torque" and not machine.lags
        if held and len(within):  # the current's mean over the step
            mixed = np.flatnonzero(within[:, 1] != within[:, 2])
            share = within[mixed, 2] / (within[mixed, 2] - within[mixed, 1])
            values[1 + mixed] += share * (within[mixed, 3] - values[1 + mixed])
        values[:] = rig.filters()[n].over(values, machine.table[st.STEP], held=held)


def _instants(rig: Rig, drive: Drive, channel: str, at: FloatArray) -> FloatArray:
    """Return when a channel with a clock of its own is read, in steps since the start of the drive."""
    if rig.is_on_time(channel):
        return at
    return np.asarray(at + rig.clock(channel, drive.origin + drive.step * at) / drive.step)


def _kick(machine: Machine, channel: str) -> float:
    """Return the immediate response of a channel to an impulse of the command, its unit per N m s."""
    if channel == "motor_torque" or machine.table[st.TARGETED] != 0.0:
        return 0.0
    at_once = machine.linear.outputs[OUTPUT_ROWS.index(channel)] @ machine.linear.g[:, 0]
    return float(at_once / machine.table[st.STEP])


def _middles(ends: FloatArray) -> FloatArray:
    """Return the values at the middle of each step from those at their ends."""
    return np.asarray(0.5 * (ends + np.concatenate([ends[:1], ends[:-1]])))


def run(machine: Machine, command: FloatArray, out: FloatArray, *, start: float = 0.0,
        reference: FloatArray | None = None, ridden: FloatArray | None = None) -> None:  # fmt: skip
    """Advance a machine over the steps of `command`, in place; `out` gets OUTPUTS of every step."""
    reference, ridden = (NOTHING_HELD if v is None else v for v in (reference, ridden))
    inputs = StepInputs(command, reference, ridden, start, True, NOTHING_WITHIN)
    advance(machine.linear, machine.calls, inputs, StepState(machine.x, machine.table, machine.effect_x), out)


def build(rig: Rig, step: float, duration: float, *, in_loop: bool = False) -> Machine:
    """Make a rig ready for steps of `step` s. duration: time in which drifts reach their full size, s."""
    settings = [(effect_named(e.name), e.parameters) for e in rig.effects]
    rig = with_structure(rig)
    active = [(e, p) for e, p in settings if e.port != st.Port.STRUCTURE]
    for e, _ in active:  # the step adds the torque of one in the spring, where the sensor is not
        if rig.ft_end == "housing_end" and e.port == st.Port.SPRING:
            raise RigError(f"rig {rig.name}: effect {e.name} with ft_end = housing_end, expected spring_end")
    reads = frozenset(r for e, _ in active for r in e.reads)
    ends = rig.clamped, rig.proximal, rig.ft_end, rig.encoder_end, rig.beside_spring
    body = _Body(rig, (*rig.values().items(), *ends, rig.train, rig.rigid_spring, rig.linear))
    linear, hanging, start_maps = _linear_part(body, step, reads)
    calls, states = _calls(rig, active, in_loop)
    table = np.zeros(st.SIZE)
    table[[st.STEP, st.DURATION, st.COMMIT]] = step, duration, 1.0
    table[[st.K_S, st.B_S, st.B_M, st.J_SC]] = _constants(rig)
    table[st.TARGETED] = float(rig.loop is not None)
    table[[st.MOBILITY, st.TURNS]] = linear.spans[0] @ linear.g[:, 0], train_ratio(rig)
    table[st.SENSED] = 1.0 - rig["spring_end.above_sensor"]
    tags = {tag for effect, values in active if any(values.values()) for tag in effect.tags}
    return Machine(
        linear, calls, np.zeros(len(linear.phi)), table, np.zeros(states), hanging,
        "lag" in tags, driven.ON_GRID if "delay" in tags else 0.5, start_maps,
    )  # fmt: skip


@dataclass(frozen=True)
class _Body:
    """A rig, equal where all that its linear part depends on is: a fit moves an effect's values, too."""

    rig: Rig = field(compare=False)
    states: tuple[object, ...]


@lru_cache(maxsize=16)
def _linear_part(
    body: _Body, step: float, reads: frozenset[int]
) -> tuple[Linear, Mechanics, dict[str, FloatArray]]:
    """Return the propagators, the equations of motion with gravity, and the start maps known so far."""
    rig = body.rig
    falling = mechanics(rig, linear_gravity=False)
    linear = propagator(rig, step, reads, falling)
    return linear, mechanics(rig) if any(rig[f"{end}.gravity"] for end in END_NAMES) else falling, {}


def _constants(rig: Rig) -> tuple[float, float, float, float]:
    k_s = 0.0 if rig.rigid_spring else rig["spring.stiffness"]
    j_sc = rig["chassis.inertia"] if math.isinf(rig["gear.stiffness"]) else 0.0
    return k_s, rig["spring.damping"], rig["rotor.reflected_damping"], j_sc


def _calls(
    rig: Rig, active: Sequence[tuple[Effect, Mapping[str, float]]], in_loop: bool
) -> tuple[Calls, int]:
    """Return the calls in the order of the ports, and how many states they own."""
    items: list[tuple[st.Port, int, Any, tuple[float, ...], int]] = [
        (e.port, e.order, e.function, e.vector(p), e.states) for e, p in active
    ]
    if in_loop:
        items.append(
            (st.Port.COMMAND, _AFTER_DELAY if rig.loop else -1, control, loop_parameters(rig), STATES)
        )
    items.sort(key=lambda item: (item[0], item[1]))
    ports = [item[0] for item in items]
    p_sizes, x_sizes = [len(i[3]) for i in items], [i[4] for i in items]
    calls = Calls(
        first=np.array([bisect_left(ports, port) for port in range(len(st.Port) + 1)], dtype=np.int64),
        address=np.array([i[2].address for i in items], dtype=np.int64),
        p_at=np.cumsum([0, *p_sizes], dtype=np.int64),
        x_at=np.cumsum([0, *x_sizes], dtype=np.int64),
        p=np.array([v for i in items for v in i[3]] or [0.0]),
        nonlinear=bool({st.Port.GEAR, st.Port.SPRING} & set(ports))
        or any(rig[f"{e}.gravity"] for e in END_NAMES),
    )
    return calls, max(1, sum(x_sizes))


_STEP_ERROR = 0.05
"""Of the noise: change by half a step from which a model is simulated on shorter ones. At 0.25 a delay that
moved the steps off the commands paid for itself, and was confirmed."""
_HALVINGS, _FALLS = 2, 0.5
"""Of a step, whose error falls by 16 while the cost grows by 4; share to which one must bring the error."""
S = TypeVar("S")
_Simulated = tuple[Drive, dict[str, FloatArray]]


def on_short_steps(first: S, halve: Callable[[S], S], change: Callable[[S, S], float]) -> S:
    """Return a simulation on steps so short that it errs less than the sensors; the first if that does.

    halve: the same on half the step. change: between two, over the noise; by half a step it is its error.
    Where half of that changes as much, as in contacts that bounce, a shorter one is no better, and not taken.
    """
    error, best, now = math.inf, first, first
    for _ in range(_HALVINGS + 1):
        halved = halve(now)
        changed = change(now, halved)
        if changed > _FALLS * error:
            break
        best, error = now, changed
        if changed < _STEP_ERROR:
            break
        now = halved
    return best


def _logged_channels(rig: Rig) -> list[str]:
    """Return the channels that a bench logs: of a position loop and a spring's encoder only listed ones."""
    listed = [n for n in OUTPUTS if n in rig.sensors]
    if rig.loop is not None and listed:
        return listed
    return [n for n in OUTPUTS if rig.measures(n) and (n != "deflection" or n in listed)]


def synthesize(rig: Rig, command: Channel, *, seed: int = 0, noise: bool = True) -> Record:
    """Return the record that a bench would have logged: measurements stamped at the end of each hold.

    On steps that err less than the sensors; a position loop samples as it steps, and has steps of its own.
    """
    period = float(command.t[-1] - command.t[0]) / (len(command) - 1)
    stamps, blank = command.t + period, np.zeros(len(command))
    names = _logged_channels(rig)
    blank_record = Record(
        {
            "command" if rig.loop is None else "reference": command,
            **{n: Channel(stamps, blank) for n in names},
        },
        source=rig.name,
    )
    rng = sensor_noise(seed)
    drive = drive_of(blank_record, rig)
    true = simulate_drive(rig, drive)
    for name, y in true.items():
        bad = ~(np.abs(y) <= LARGEST)
        if bad.any():
            k = int(np.argmax(bad))
            raise RigError(
                f"rig {rig.name}: its simulation runs away, {name} is {y[k]:g} at sample {k}, "
                f"expected at most {LARGEST:g}: check the rig's values and effects"
            )
    if rig.loop is None:
        true = _on_short_steps(rig, drive, true)
    chain = Filters(rig, period, period)
    measured = {n: Channel(stamps, measure(rig, n, true[n], rng, chain) if noise else true[n]) for n in names}
    return blank_record.with_channels(**measured)


def _on_short_steps(rig: Rig, drive: Drive, true: dict[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the channels of a drive on steps that err less than the sensors. true: on its own steps."""
    noises = {n: rig.sensors[n].noise for n in true if n in rig.sensors and rig.sensors[n].noise > SMALLEST}

    def change(before: _Simulated, after: _Simulated) -> float:
        squares = ((np.mean((before[1][n] - after[1][n]) ** 2), noise) for n, noise in noises.items())
        return max((math.sqrt(square) / noise for square, noise in squares), default=0.0)

    def halved(simulated: _Simulated) -> _Simulated:
        return (half := driven.finer(simulated[0])), simulate_drive(rig, half)

    return on_short_steps((drive, true), halved, change)[1]


def sensor_noise(seed: int) -> np.random.Generator:
    """Return the source of the noise of sensors: not the numbers of an excitation of the same seed."""
    return np.random.default_rng([seed, _SENSORS])


class Filters:
    """The filters of a rig's sensors, with what they remember, for a bench that is read sample by sample.

    step: of the simulation, period: between readings, s. held: the current is, within a step.
    """

    def __init__(self, rig: Rig, step: float, period: float, *, held: bool = True) -> None:
        self._true, self._noise = [], {}
        for n, known in rig.filters().items():
            self._noise[n] = Running(known.coefficients(period, held=True))
            of_step = known.coefficients(step, held=held and n == "motor_torque")
            rows, true = slice(None), Running(of_step, first=0.0)
            if known.is_sampled:
                rows, true = slice(-1, None), Running(known.coefficients(period))
            self._true.append((rows, OUTPUTS.index(n), true))

    def apply(self, out: FloatArray) -> None:
        """Replace OUTPUTS at the ends of steps, a row each, the last of them a sample, by what has passed."""
        for rows, k, running in self._true:
            out[rows, k] = running(out[rows, k])

    def noise(self, channel: str, noise: FloatArray) -> FloatArray:
        """Return what passes of the noise of a channel's samples, of its shape."""
        running = self._noise.get(channel)
        return noise if running is None else running(np.atleast_1d(noise)).reshape(np.shape(noise))


def measure(
    rig: Rig, channel: str, value: FloatArray, rng: np.random.Generator, filters: Filters | None = None
) -> FloatArray:
    """Return the readings of the rig's sensor for true values: noise added, rounded to its quantum.

    filters: for a sensor with a filter, which the values have passed already.
    """
    sensor = rig.sensors.get(channel)
    if sensor is None:
        return value
    noise = sensor.noise * rng.standard_normal(np.shape(value))
    noisy = value + (noise if filters is None else filters.noise(channel, noise))
    return np.round(noisy / sensor.quantum) * sensor.quantum if sensor.quantum > SMALLEST else noisy


class Sensors:
    """The sensors of a rig, as `measure` reads one: a study takes 50 000 samples, a bench 10 000 a second."""

    def __init__(self, rig: Rig) -> None:
        self._seen = np.array([k for k, name in enumerate(OUTPUTS) if name in rig.sensors], dtype=np.intp)
        sensors = [rig.sensors[OUTPUTS[k]] for k in self._seen]
        self._noises, quanta = np.array([s.noise for s in sensors]), np.array([s.quantum for s in sensors])
        self._filtered = [i for i, s in enumerate(sensors) if s.filter]
        self._rounds = quanta > SMALLEST
        self._quanta = np.where(self._rounds, quanta, 1.0)

    def read(self, true: FloatArray, rng: np.random.Generator, filters: Filters) -> FloatArray:
        """Return the readings of all of OUTPUTS, of which those without a sensor are the true values."""
        values: FloatArray = true.copy()
        if len(self._seen):
            noise = self._noises * rng.standard_normal(len(self._seen))
            for i in self._filtered:
                noise[i] = filters.noise(OUTPUTS[self._seen[i]], noise[i])
            noisy = values[self._seen] + noise
            values[self._seen] = np.where(self._rounds, np.rint(noisy / self._quanta) * self._quanta, noisy)
        return values


@dataclass(frozen=True)
class PlantSample:
    """One measurement of the plant: rad, rad/s, N m, N m (nan without a spring to measure), rad."""

    position: float
    velocity: float
    motor_torque: float
    ft: float
    deflection: float


class Plant:
    """A bench that is stepped one sample at a time, with the noise and the quantum of its sensors."""

    def __init__(self, rig: Rig, rate: float, *, seed: int = 0, noise: bool = True) -> None:
        """rate: samples a second. Drifts reach their full size in a minute."""
        self._rig, self._sensors = rig, Sensors(rig if noise else replace(rig, sensors={}))
        self._count = driven.steps_per_sample(1.0 / rate)
        self._step = 1.0 / rate / self._count
        self._command, self._out = np.empty(self._count), np.empty((self._count, len(OUTPUTS)))
        self._rng = sensor_noise(seed)
        self.reset()

    def reset(self) -> None:
        """Go back to rest, at time zero."""
        self._machine = build(self._rig, self._step, 60.0)
        period, held = self._count * self._step, not self._machine.lags
        self._filters = Filters(self._rig, self._step, period, held=held)
        self._time = 0.0

    def step(self, command: float) -> PlantSample:
        """Hold a command (N m) for one sample period and return the measurement at its end."""
        self._command.fill(command)
        run(self._machine, self._command, self._out, start=self._time)
        self._time += self._count * self._step
        self._filters.apply(self._out)
        values = self._sensors.read(self._out[-1], self._rng, self._filters)
        position, velocity, torque, ft, deflection = values.tolist()
        return PlantSample(position, velocity, torque, math.nan if self._rig.rigid_spring else ft, deflection)
