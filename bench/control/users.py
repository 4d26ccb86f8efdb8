"""What users try first: an arm pushed, an arm that works, a load that changes, a torque held, an impact.

The bench shares no code with the project: a motor and an arm on both sides of a spring, Coulomb friction
that sticks, play, a wall; 40 kHz, semi-implicit. The controllers get ft and velocity at the samples, with the
noise of the rig's sensors, and command one sample later; none has a measured motor torque.

Textbook controllers: the inverse of the locked actuator on r with PD on the torque error, without and with a
disturbance observer on the torque (baselines.py has both, with sources). Their gains are those with the
softest output at 1 and 3 Hz that keep what is asked of ours (synthesis.py): the same set of benches,
sensitivities and noise.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numba import njit
from scipy.optimize import minimize

from bench.control.baselines import Step, Values, none, ours, paine, pratt_williamson
from bench.results import Row
from rsea_ros.control.law import FT, z_of
from rsea_ros.control.margins import encirclements
from rsea_ros.control.synthesis import HEAVY, DesignLimits, design, grid
from rsea_ros.control.uncertainty import assumed, corners, family, load_range, lock
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import ComplexArray, FloatArray

FINE = 40_000.0
"""Hz, of the bench."""
LIMIT = 68.0
"""N m, of the motor."""
J_ARM, B_ARM, K_ARM = 0.1, 1.0, 20.0
"""An elbow: kg m^2, N m s/rad, N m/rad (Hogan, IEEE Trans. Automatic Control 29, 1984; relaxed)."""


@njit(cache=True)  # type: ignore[untyped-decorator]
def _hold(x, u, push, n, dt, p):  # type: ignore[no-untyped-def]
    """Advance q, w, arm's angle and speed by n steps under a motor torque and a push; return the torque."""
    j, b, k, d, friction, gap, j_l, b_l, k_l, wall, hand, speed = p
    torque = 0.0
    for _ in range(n):
        stretch, rate = x[0] - x[2], x[1] - x[3]
        beyond = stretch - 0.5 * gap if stretch > 0.5 * gap else min(stretch + 0.5 * gap, 0.0)
        torque = k * beyond + d * rate if gap == 0.0 or beyond != 0.0 else 0.0
        if gap > 0.0 and torque * beyond < 0.0:
            torque = 0.0
        free = x[1] + dt * (u - b * x[1] - torque) / j
        most = dt * friction / j
        x[1] = free - min(max(free, -most), most)
        x[0] += dt * x[1]
        if j_l < 1e6:
            pressed = x[2] - wall
            stop = 2e4 * pressed + 20.0 * x[3] if pressed > 0.0 else 0.0
            held = hand * (speed - x[3])
            x[3] += dt * (torque + push + held - b_l * x[3] - k_l * x[2] - max(stop, 0.0)) / j_l
            x[2] += dt * x[3]
    return torque


@dataclass
class Bench:
    """A bench with an arm, one sample at a time. late: samples, delay: s, of commands beyond the one."""

    rig: Rig
    rate: float
    arm: tuple[float, float, float] = (math.inf, 0.0, 0.0)
    friction: float = 0.0
    gap: float = 0.0
    wall: float = math.inf
    hand: float = 0.0
    speed: float = 0.0
    late: int = 0
    delay: float = 0.0
    seed: int = 1
    x: FloatArray = field(default_factory=lambda: np.zeros(4))
    sent: list[float] = field(default_factory=list)
    acting: float = 0.0

    def __post_init__(self) -> None:
        self._noise = np.random.default_rng(self.seed)
        self.sent = [0.0] * (self.late + int(self.delay * self.rate + 1e-9))
        self.sensors = tuple(self.rig.sensors[name].noise for name in ("ft", "velocity"))
        self.torque = 0.0

    def step(self, command: float, push: float = 0.0) -> tuple[float, float]:
        """Hold a command (N m) for a sample; return the readings of ft and velocity at its end."""
        r = self.rig
        p = (
            r["rotor.reflected_inertia"] + r["chassis.inertia"], r["rotor.reflected_damping"],
            r["spring.stiffness"], r["spring.damping"], self.friction, self.gap,
            *self.arm, self.wall, self.hand, self.speed,
        )  # fmt: skip
        self.sent.append(min(max(command, -LIMIT), LIMIT))
        new, whole = self.sent.pop(0), round(FINE / self.rate)
        first = round(self.delay * FINE) % whole
        if first:
            _hold(self.x, self.acting, push, first, 1.0 / FINE, p)
        self.torque = float(_hold(self.x, new, push, whole - first, 1.0 / FINE, p))
        self.acting = new
        a, b = self._noise.standard_normal(2)
        return self.torque + self.sensors[0] * a, float(self.x[1]) + self.sensors[1] * b


@dataclass(frozen=True)
class Run:
    """t (s), desired, ft without noise (N m), speed of the arm (rad/s), command (N m) at the samples."""

    t: FloatArray
    desired: FloatArray
    ft: FloatArray
    speed: FloatArray
    command: FloatArray

    def error(self, begin: float, end: float = math.inf) -> float:
        """Return the RMS error over the RMS of the desired torque from begin to end, s."""
        at = (self.t >= begin) & (self.t < end)
        return float(np.sqrt(np.mean((self.ft - self.desired)[at] ** 2) / np.mean(self.desired[at] ** 2)))


Signal = Callable[[float], float]


def play(
    step: Step,
    bench: Bench,
    seconds: float,
    desired: Signal,
    push: Signal = lambda t: 0.0,
    change: Callable[[Bench, float], None] = lambda bench, t: None,
    lost: float = 0.0,
) -> Run:
    """Run a controller; lost: part of the samples that it does not get: NaN."""
    n, h = round(seconds * bench.rate), 1.0 / bench.rate
    rows, command, pending = np.empty((n, 4)), 0.0, 0.0
    dice = np.random.default_rng(7)
    ft, velocity = bench.step(0.0)
    for k in range(n):
        t = k * h
        change(bench, t)
        wanted = desired(t)
        gone = dice.random() < lost
        command = step(math.nan, math.nan, wanted) if gone else step(ft, velocity, wanted)
        rows[k] = wanted, bench.torque, bench.x[3], command
        ft, velocity = bench.step(pending, push(t))
        pending = command
    return Run(np.arange(n) * h, *rows.T)


ARM = (J_ARM, B_ARM, K_ARM)
PENDULUM = (0.101, 0.02, 7.0)


def felt(begin: Callable[[], Step], rig: Rig, rate: float, hz: float) -> float:
    """Return |Z|, N m s/rad, of an arm that is pushed by a sine of 4 N m; the torque wanted is 0."""
    run = play(
        begin(), Bench(rig, rate, ARM), 2.0 + 8.0 / hz, lambda t: 0.0,
        lambda t: 4.0 * math.sin(2.0 * math.pi * hz * t),
    )  # fmt: skip
    turn = np.exp(-2j * np.pi * hz * run.t) * (run.t >= 2.0)
    return float(abs(np.sum(run.ft * turn) / np.sum(run.speed * turn)))


def noise_below(hz: float, rms: float, seconds: float, rate: float, seed: int = 3) -> Signal:
    """Return a torque of white noise below a frequency, N m."""
    rng = np.random.default_rng(seed)
    lines = np.arange(0.1, hz, 1.0 / seconds)
    phases = rng.uniform(0.0, 2.0 * np.pi, len(lines))
    t = np.arange(round(seconds * rate) + 1) / rate
    x = np.sum(np.cos(2.0 * np.pi * np.outer(t, lines) + phases), axis=1)
    x *= rms / np.sqrt(np.mean(x**2)) * np.minimum(1.0, 2.0 * t)
    return lambda t: float(x[round(t * rate)])


def work(begin: Callable[[], Step], rig: Rig, rate: float) -> float:
    """Return the error, %, of wide-band work with the arm, 1.5 N m RMS below 6 Hz."""
    run = play(begin(), Bench(rig, rate, ARM), 12.0, noise_below(6.0, 1.5, 12.0, rate))
    return 100.0 * run.error(4.0)


def sine_of(amplitude: float, hz: float = 5.0) -> Signal:
    """Return a sine, N m, that comes up within a quarter of a second."""
    return lambda t: amplitude * min(1.0, 4.0 * t) ** 2 * math.sin(2.0 * math.pi * hz * t)


def heavier(begin: Callable[[], Step], rig: Rig, rate: float) -> float:
    """Return the error, %, in the first half second after a free load has become 4 times as heavy."""

    def change(bench: Bench, t: float) -> None:
        bench.arm = (0.101 if t < 3.0 else 0.404, 0.02, 7.0)

    run = play(begin(), Bench(rig, rate, PENDULUM), 3.5, sine_of(2.0), change=change)
    return 100.0 * run.error(3.0)


def held(begin: Callable[[], Step], rig: Rig, rate: float) -> float:
    """Return the scatter, % of the torque, of 5 N m held against a wall with friction and play."""
    bench = Bench(rig, rate, friction=2.0, gap=3e-3)
    run = play(begin(), bench, 12.0, lambda t: 5.0 * min(1.0, 2.0 * t))
    return 100.0 * float(np.std(run.ft[run.t >= 4.0])) / 5.0


def impact(begin: Callable[[], Step], rig: Rig, rate: float) -> float:
    """Return the largest torque, N m, after motor and arm, moved at 2.4 rad/s, have met a stiff wall."""
    bench = Bench(rig, rate, (J_ARM, B_ARM, 0.0), hand=500.0)

    def change(bench: Bench, t: float) -> None:
        bench.speed = 2.4 * min(1.0, 2.0 * t)
        if t >= 1.0 and bench.hand:
            bench.x[:] = bench.x[2], 2.4, bench.x[2], 2.4
            bench.hand, bench.wall = 0.0, float(bench.x[2])

    run = play(begin(), bench, 2.0, lambda t: 0.0, change=change)
    return float(np.abs(run.ft[run.t > 1.0]).max())


def follow(begin: Callable[[], Step], bench: Bench, amplitude: float, lost: float = 0.0) -> float:
    """Return the error, %, of a sine of 5 Hz."""
    return 100.0 * min(play(begin(), bench, 5.0, sine_of(amplitude), lost=lost).error(3.0), 9.99)


def rows(rig: Rig, rate: float) -> Mapping[str, Callable[[Callable[[], Step]], float]]:
    """Return the experiments by name."""
    late = Bench(rig, rate, late=1, delay=2e-3)
    off = rig.with_values({
        "spring.stiffness": 1.1 * rig["spring.stiffness"],
        "rotor.reflected_damping": 0.5 * rig["rotor.reflected_damping"],
    })  # fmt: skip
    return {
        "arm pushed, |Z| at 1 Hz, N·m·s/rad": lambda c: felt(c, rig, rate, 1.0),
        "arm pushed, |Z| at 3 Hz, N·m·s/rad": lambda c: felt(c, rig, rate, 3.0),
        "arm, work below 6 Hz, 1.5 N·m RMS, error %": lambda c: work(c, rig, rate),
        "load × 4 in mid-run, first 0.5 s, error %": lambda c: heavier(c, rig, rate),
        "5 N·m held, friction and play, RMS %": lambda c: held(c, rig, rate),
        "impact at 2.4 rad/s, peak N·m": lambda c: impact(c, rig, rate),
        "5 Hz, locked, error %": lambda c: follow(c, Bench(rig, rate), 10.0),
        "5 Hz, free, error %": lambda c: follow(c, Bench(rig, rate, PENDULUM), 4.0),
        "5 Hz, half that load, error %": lambda c: follow(c, Bench(rig, rate, (0.05, 0.02, 7.0)), 2.1),
        "5 Hz, K_s + 10 %, b_m - 50 %, error %": lambda c: follow(c, Bench(off, rate), 10.0),
        "5 Hz, a sample and 2 ms late, error %": lambda c: follow(c, late, 10.0),
        "5 Hz, 5 % of the samples lost, error %": lambda c: follow(c, Bench(rig, rate), 10.0, lost=0.05),
    }  # fmt: skip


def second_order(hz: float, h: float, z: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return the responses y, rate and second rate of `baselines.Filter`."""
    w, summed = 2.0 * math.pi * hz, h / (1.0 - 1.0 / z)
    second = w * w / ((1.0 + w * h) ** 2 + (w * w * summed**2 + 2.0 * w * summed) / z)
    return summed**2 * second, summed * second, second


def loop_of(rig: Rig, h: float, x: Values, hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Return the response from ft to the command, sign turned, and 1 less what is fed back of that."""
    z = z_of(h, hz)
    y, rate, _ = second_order(x[0], h, z)
    on_ft, memory = x[1] * y + x[2] * rate, np.zeros_like(z)
    if len(x) > 3:
        j, b, k = rig["rotor.reflected_inertia"], rig["rotor.reflected_damping"], rig["spring.stiffness"]
        y, rate, second = second_order(x[3], h, z)
        on_ft, memory = on_ft + x[4] * (y + (b * rate + j * second) / k), x[4] * y / z**2
    return on_ft, 1.0 - memory


def textbook(rig: Rig, free: Rig, rate: float, starts: Sequence[Values]) -> Values:
    """Return the gains of PD (3) or PD and observer (5): the softest that keep what is asked of ours."""
    h, hz = 1.0 / rate, grid(rate, 100)
    u, demand, z = assumed(rig, rate), DesignLimits(), z_of(1.0 / rate, hz)
    loads = {n: load for n, load in load_range(rig, free).items() if not n.endswith(HEAVY)}
    set_of = family(loads, corners(tuple(loads), u), rate, hz)
    most = np.where(set_of.nominal, demand.sensitivity, demand.robust)
    soft, s = np.array([1.0, 3.0]), 2j * np.pi * np.array([1.0, 3.0])
    z_m = rig["rotor.reflected_inertia"] * s + rig["rotor.reflected_damping"]

    def cost(x: FloatArray) -> float:
        gains = np.exp(x)
        on_ft, kept = loop_of(rig, h, gains, hz)
        whole = kept + set_of.plant[FT] * set_of.path * on_ft / z
        peaks = (np.maximum(np.abs(kept), 1.0) / np.abs(whole)).max(axis=1)
        noise = rig.sensors["ft"].level * np.sqrt(2.0 * np.trapezoid(np.abs(on_ft / whole[0]) ** 2, hz) * h)
        over = np.sum(np.maximum(0.0, peaks / most - 1.0)) + max(0.0, noise / (demand.noise * LIMIT) - 1.0)
        over += 10.0 * np.count_nonzero(encirclements(whole) > 0.5)
        on_ft, kept = loop_of(rig, h, gains, soft)
        return float(np.mean(np.log(np.abs(z_m / (1.0 + on_ft / kept)))) + 20.0 * over)

    def searched(x: FloatArray) -> FloatArray:
        simplex = x + np.vstack([np.zeros(len(x)), 0.4 * np.eye(len(x))])
        options = {"maxfev": 250, "adaptive": True, "initial_simplex": simplex}
        return np.asarray(minimize(cost, x, method="Nelder-Mead", options=options).x)

    x = min((searched(np.log(start)) for start in starts), key=cost)
    for _ in range(3):
        x = searched(x)
    return [float(value) for value in np.exp(x)]


def holding(method: Callable[[Rig, float, Values], Step], rig: Rig, h: float, x: Values) -> Step:
    """Return a controller of the textbook; a sample that it does not get leaves its command as it is."""
    inner, sent = method(rig, h, x), [0.0]

    def step(ft: float, velocity: float, r: float) -> float:
        if math.isfinite(ft):
            sent[0] = inner(ft, velocity, r)
        return sent[0]

    return step


PD = ((60.0, 1.0, 0.01), (300.0, 5.0, 0.05), (100.0, 10.0, 0.1))
DOB = tuple((*x, q, part) for x in PD for q, part in ((6.0, 0.5), (40.0, 0.9)))
"""Gains at which the searches of the textbook controllers begin."""


def users(rig: Rig, free: Rig, rate: float) -> Iterator[Row | str]:
    """Print the users' first experiments at a rate."""
    pd, dob = textbook(rig, free, rate, PD), textbook(rig, free, rate, DOB)
    for name, x in (("PD", pd), ("PD + DOB", dob)):
        yield f"{rate:g} Hz, {name}: {', '.join(f'{value:.3g}' for value in x)}"
    gains = design(rig, load_range(rig, free), rate).gains
    made: dict[str, Callable[[], Step]] = {
        "no controller": partial(none, rig, 1.0 / rate, ()),
        "PD + feed-forward": partial(holding, pratt_williamson, rig, 1.0 / rate, pd),
        "PD + feed-forward + DOB": partial(holding, paine, rig, 1.0 / rate, dob),
        "this project's": partial(ours, lock(rig), rate, gains),
    }
    for what, experiment in rows(rig, rate).items():
        yield Row(f"{what}, {rate:g} Hz", "", {n: _text(experiment(begin)) for n, begin in made.items()})


def _text(value: float) -> str:
    return "over 150" if value > 150.0 else f"{value:.2g}" if value < 100.0 else f"{value:.0f}"
