"""The observer assembled from the rig's linear model; the noise of its signals, and if innovations have it.

z = (q, q', d[, zero]),   z' = A z + w,   d the disturbance torque on the gear output, against the housing

Measured and estimated signals are rows on z. The torques on both ends have torques at the ports in them at
once (outputs.py): y = C x + D tau.

The disturbance is a random walk. Its intensity comes from a torque of RMS sigma that keeps for a time tau:
over times short against tau such an Ornstein-Uhlenbeck process is a random walk of intensity

    2 sigma^2 / tau    (N m)^2/s

tau = 1 / |slowest pole| of the actuator between clamped ends: the filter follows anything slower.
sigma is the residual of the F/T signal beyond its noise, and never less than the doubt in the measured
motor torque: a torque too small for that sensor cannot be excluded.
Source: Gardiner, Handbook of Stochastic Methods, 2004, section 3.8.4.

Where the model is right nu^2 / S, the squared innovation over its variance, is chi-square distributed with
one degree of freedom and white: the sum over a window of n samples has n degrees of freedom.
Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, sec. 5.4.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import matrix_balance
from scipy.special import chdtri  # chi2.isf, without the 0.3 s of scipy.stats

from rsea_ros.documents.units import plain
from rsea_ros.effects import signal_table as st
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import RigError
from rsea_ros.model import outputs
from rsea_ros.model.drive import LONGEST_STEP
from rsea_ros.model.equations import PORTS, with_structure
from rsea_ros.model.observer import filter as kf
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import END_NAMES, Rig, check_unfiltered
from rsea_ros.model.simulation import Machine, build
from rsea_ros.model.step import Calls
from rsea_ros.model.transfer import read
from rsea_ros.records.record import UNITS, FloatArray

NOTHING: Mapping[str, float] = {}


@dataclass(frozen=True)
class Noise:
    """One sigma of position (rad), ft (N m) and motor torque (N m; 0: not measured); of the disturbance
    (N m), and its correlation time, s. A channel that the rig's sensors lack is infinite: it adds no
    information.
    """

    position: float
    ft: float
    motor_torque: float
    disturbance: float
    tau: float

    @property
    def walk(self) -> float:
        """Intensity of the disturbance's random walk, (N m)^2/s."""
        return 2.0 * self.disturbance**2 / self.tau


def noise_of(rig: Rig, noise_rms: Mapping[str, float] = NOTHING,
             residual_rms: Mapping[str, float] = NOTHING) -> Noise:  # fmt: skip
    """Return the noise of a rig's sensors, or that measured by an identification, by channel.

    Raises RigError where neither has a sensor of the rig.
    """
    position, ft, torque = (_sigma(rig, n, noise_rms) for n in ("position", "ft", "motor_torque"))
    if math.isinf(position) and math.isinf(ft):
        raise RigError(f"rig {rig.name}: sensors {', '.join(rig.sensors)}, expected position or ft")
    known = [s for s in (torque, ft) if math.isfinite(s)]
    unexplained = residual_rms.get("ft", 0.0) ** 2 - (ft**2 if math.isfinite(ft) else 0.0)
    sigma = max(known[0] if known else 0.0, math.sqrt(max(0.0, unexplained)))
    if sigma == 0.0:
        raise RigError(f"rig {rig.name}: sensors has no torque, expected motor_torque or ft with noise, N·m")
    held = rig if rig.rigid_spring else replace(rig, clamped=frozenset(END_NAMES))
    rates = np.abs(np.linalg.eigvals(state_space(held).a))
    slowest = float(rates[rates > 1e-6 * rates.max()].min())
    return Noise(position, ft, torque if math.isfinite(torque) else 0.0, sigma, 1.0 / slowest)


def _sigma(rig: Rig, channel: str, noise_rms: Mapping[str, float]) -> float:
    if channel not in rig.sensors:
        return math.inf
    sensor = rig.sensors[channel]
    sigma = noise_rms.get(channel, sensor.level)
    if not sigma > 0.0:
        raise RigError(
            f"rig {rig.name}: sensors.{channel}.noise = {sigma:g} {plain(UNITS[channel])}, "
            "expected > 0, as measured"
        )
    return sigma


CHANNELS = ("position", "ft", "motor_torque")
FALSE_ALARM = 1e-6
"""Probability that a right model is called inconsistent in a window: once in ten days of windows of 1 s."""


class Consistency(NamedTuple):
    """ratio: RMS of the innovations over its expected value.

    limit: the largest allowed. mean: in the channel's unit.
    """

    ratio: float
    limit: float
    mean: float

    @property
    def broken(self) -> bool:
        """Whether the model is inconsistent with this channel."""
        return self.ratio > self.limit


def consistency(score: FloatArray) -> dict[str, Consistency]:
    """Return the test of each channel that had samples. score: sums of nu^2 / S, 1, nu, shape (3, 3).

    A late sample changes innovations that were already counted, so a sum may decrease: to zero at least.
    """
    return {
        name: Consistency(math.sqrt(max(total, 0.0) / count), _limit(round(count)), sum_ / count)
        for name, (total, count, sum_) in zip(CHANNELS, score.tolist(), strict=True)
        if count >= 1.0 and math.isfinite(total + sum_)
    }


@lru_cache(maxsize=64)
def _limit(count: int) -> float:
    return math.sqrt(float(chdtri(count, FALSE_ALARM)) / count)


_GEAR_PLACE = PORTS.index("gear")
ANGLE, SPEED = 1.0, 100.0
"""One sigma of what is not known at all at the start, rad, rad/s: far more than a bench has."""


@dataclass(frozen=True)
class LinearModel:
    """a: shape (n, n). block: [[A, B], [0, 0]] of the mechanics without gravity, for the mean.

    estimated: rows of T_d and T_p on z, shape (2, n). torques: rows on the torques at equations.PORTS,
    shape (2, 5). start: sigmas of z at the beginning but for the disturbance's, shape (n,).
    """

    a: FloatArray
    block: FloatArray
    estimated: FloatArray
    torques: FloatArray
    start: FloatArray

    @property
    def order(self) -> int:
        """Number of mechanical states, 2 for each coordinate."""
        return len(self.block) - len(PORTS)


def linear_model(rig: Rig) -> LinearModel:
    """Return the filter's model of a rig whose effects have changed its structure already."""
    falling, system = state_space(rig), state_space(rig, linear_gravity=False)
    n, zero = len(system.a), rig.zero_unknown("position")
    size = n + 1 + zero
    a, block = np.zeros((size, size)), np.zeros((n + len(PORTS), n + len(PORTS)))
    a[:n, :n], a[:n, n] = falling.a, falling.b[:, _GEAR_PLACE]
    block[:n, :n], block[:n, n:] = system.a, system.b
    rows = [read(system, output) for output in (outputs.distal(rig), outputs.proximal(rig))]
    torques = np.array([d for _, d in rows])
    estimated = np.zeros((2, size))
    estimated[:, :n], estimated[:, n] = [c for c, _ in rows], torques[:, _GEAR_PLACE]
    half = n // 2
    start = np.array([ANGLE] * half + [SPEED] * half + [0.0] + [ANGLE] * zero)
    return LinearModel(a, block, estimated, torques, start)


_GEAR = int(st.Port.GEAR)


def without_delay(rig: Rig) -> tuple[Rig, float]:
    """Return the rig without a delay of its command, and that delay, s.

    The observer's steps follow the stamps, so the effect's ring of steps cannot serve.
    The delay moves the commands' stamps instead, which is exact.
    """
    delays = [e for e in rig.effects if "delay" in effect_named(e.name).tags]
    delay = sum(e.parameters[effect_named(e.name).main.name] for e in delays)
    return rig.with_effects(*(e for e in rig.effects if e not in delays)), float(delay)


def assemble(
    rig: Rig, noise: Noise, *, hold: float, duration: float, learns: bool
) -> tuple[kf.FilterModel, kf.FilterState]:
    """Return the model and the state at rest with nothing known. hold, duration: s; learns: filter.py."""
    check_unfiltered(rig, ("position", "ft", "motor_torque"), "the observer, which has no state of it")
    machine, linear = build(rig, LONGEST_STEP, duration), linear_model(with_structure(rig))
    n, size = linear.order, len(linear.start)
    measured = np.zeros((2, size))
    measured[:, :n] = machine.linear.outputs[[0, 2]]
    measured[0, n + 1 :] = 1.0
    a, scale = _balance(linear.a)
    block, block_scale = _balance(linear.block)
    walk = np.zeros((size, size))
    walk[n, n] = noise.walk / scale[n] ** 2
    estimated = linear.estimated
    model = kf.FilterModel(
        linear=machine.linear._replace(phi=np.eye(n), g=np.zeros((n, len(PORTS)))),
        calls=_with_disturbance(machine.calls),
        block=block, block_scale=block_scale, a=a, walk=walk, scale=scale,
        f=np.eye(size), q=np.zeros((size, size)), measured=measured,
        spreads=learns * _spreads(rig, machine.linear.outputs[3]),
        noise=np.array([noise.position, noise.ft, noise.motor_torque]) ** 2,
        estimated=estimated, torques=linear.torques, held=np.zeros(2), hold=hold,
    )  # fmt: skip
    state = _state(n, size, machine)
    state.p[:] = np.diag(linear.start**2)
    state.p[n, n] = noise.disturbance**2
    state.learnt[kf.FIXED] = not learns
    return model, state


def _spreads(rig: Rig, deflection: FloatArray) -> FloatArray:
    """Return rows on the mechanics of the torques that one sigma of K_s and b_s makes, shape (2, n), N m."""
    stiffness, damping = (rig[name] * rig.spread(name) if name in rig.quantities else 0.0
                          for name in ("spring.stiffness", "spring.damping"))  # fmt: skip
    return np.array([stiffness * deflection, damping * np.roll(deflection, len(deflection) // 2)])


def _balance(a: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a matrix balanced in its rows and columns, and the scale that balances it."""
    balanced, (scale, _) = matrix_balance(a, permute=False, separate=True)
    return np.ascontiguousarray(balanced), np.ascontiguousarray(scale)


def _with_disturbance(calls: Calls) -> Calls:
    """Return the calls with the disturbance before the effects at the gear; its torque is p[0]."""
    first, at = calls.first.copy(), int(calls.first[_GEAR])
    first[_GEAR + 1 :] += 1
    return Calls(
        first=first,
        address=np.insert(calls.address, at, kf.disturbance.address),
        p_at=np.insert(calls.p_at + 1, at, 0),
        x_at=np.insert(calls.x_at, at, 0),
        p=np.concatenate([[0.0], calls.p]),
        nonlinear=True,
    )


def _state(n: int, size: int, machine: Machine) -> kf.FilterState:
    """Return a state of zeros, all its parts views of one array."""
    states = len(machine.effect_x)
    learnt, brief = kf.SIGMA + 3, kf.BRIEF + len(kf.WINDOWS)
    sizes = (n, size - n, size * size, st.SIZE, states, n, 3, learnt, kf.CLOCK, 9, brief)
    whole = np.zeros(sum(sizes))
    parts = np.split(whole, np.cumsum(sizes)[:-1])
    state = kf.FilterState(whole, *parts)
    state.table[:] = machine.table
    state.learnt[kf.WALK] = 1.0
    return state._replace(p=state.p.reshape(size, size))
