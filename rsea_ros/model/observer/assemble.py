"""The observer assembled from the rig's linear model.

z = (q, q', d[, zero]),   z' = A z + w,   d the disturbance torque on the gear output, against the housing

Measured and estimated signals are rows on z. The torques on both ends have torques at the ports in them at
once (outputs.py): y = C x + D tau.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import matrix_balance

from rsea_ros.effects import signal_table as st
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model import outputs
from rsea_ros.model.drive import LONGEST_STEP
from rsea_ros.model.equations import PORTS, with_structure
from rsea_ros.model.observer import filter as kf
from rsea_ros.model.observer.signal_noise import Noise
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import Machine, build
from rsea_ros.model.step import Calls
from rsea_ros.model.transfer import read
from rsea_ros.records.record import FloatArray

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
