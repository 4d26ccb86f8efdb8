"""From the equations of motion to the propagators of one step."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from rsea_ros.effects import signal_table as st
from rsea_ros.model.equations import Mechanics, mechanics, train_ratio
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.step import Linear
from rsea_ros.records.record import FloatArray

_DIFFERENCES = {
    st.GEAR_ANGLE: (-1.0, 1.0, 0.0, 0.0, 0.0),
    st.OUTPUT_ANGLE: (-1.0, 0.0, 1.0, 0.0, 0.0),
    st.DEFLECTION: (0.0, 0.0, 1.0, -1.0, 0.0),
    st.JOINT_ANGLE: (0.0, 1.0, -1.0, 0.0, 0.0),
    st.HOUSING_ANGLE: (0.0, 0.0, 0.0, 0.0, 1.0),
    st.DISTAL_ANGLE: (0.0, 0.0, 0.0, 1.0, 0.0),
}


_LOAD_ANGLE = (-1.0, 0.0, 0.0, 1.0, 0.0)
"""The spring end against the housing."""


@dataclass(frozen=True)
class StateSpace:
    """x' = A x + B tau with x = (q, q') and tau the torques at equations.PORTS."""

    a: FloatArray
    b: FloatArray
    mechanics: Mechanics


def state_space(rig: Rig, *, linear_gravity: bool = True) -> StateSpace:
    """Return A, shape (2n, 2n), and B, shape (2n, 5), of a rig."""
    return _space_of(mechanics(rig, linear_gravity=linear_gravity))


def _space_of(m: Mechanics) -> StateSpace:
    n = m.order
    a = np.zeros((2 * n, 2 * n))
    a[:n, n:] = np.eye(n)
    a[n:, :n] = -np.linalg.solve(m.mass, m.stiffness)
    a[n:, n:] = -np.linalg.solve(m.mass, m.damping)
    b = np.zeros((2 * n, m.ports.shape[0]))
    b[n:] = np.linalg.solve(m.mass, m.ports.T)
    return StateSpace(a, b, m)


def read_row(rig: Rig, m: Mechanics, signal: int) -> FloatArray:
    """Return the row that reads a signal of the table (ROTOR_ANGLE … DISTAL_VELOCITY) from x."""
    n = m.order
    if signal == st.ROTOR_ANGLE:
        return train_ratio(rig) * read_row(rig, m, st.GEAR_ANGLE)
    is_rate = signal not in _DIFFERENCES
    difference = np.array(_DIFFERENCES[signal - 1 if is_rate else signal])
    row = np.zeros(2 * n)
    row[n * is_rate : n * is_rate + n] = difference @ m.placement
    return row


def encoder_row(rig: Rig, m: Mechanics, *, is_rate: bool = False) -> FloatArray:
    """Return the row that gives the encoder's reading from x: an angle, or its rate."""
    difference = np.array(_LOAD_ANGLE if rig.encoder_end == "spring_end" else _DIFFERENCES[st.OUTPUT_ANGLE])
    row = np.zeros(2 * m.order)
    row[m.order * is_rate : m.order * (is_rate + 1)] = difference @ m.placement
    return row


def propagator(rig: Rig, h: float, reads: Iterable[int], m: Mechanics | None = None) -> Linear:
    """Return the propagators of a step of h seconds, by one matrix exponential.

    m: the equations of motion without gravity, where they are known already.
    expm of [[A h, B h], [0, 0]] holds e^{Ah} and G (Van Loan, IEEE TAC 23, 1978).
    """
    system = _space_of(m or mechanics(rig, linear_gravity=False))
    n, ports = system.b.shape
    block = np.zeros((n + ports, n + ports))
    block[:n, :n], block[:n, n:] = system.a * h, system.b * h
    exponential = expm(block)
    reads = set(reads)
    reads_load = st.LOAD in reads
    angles = {st.HOUSING_ANGLE: "housing_end.gravity", st.DISTAL_ANGLE: "spring_end.gravity"}
    reads |= {signal for signal, name in angles.items() if rig[name] != 0.0}
    if reads_load:
        spring, output = {st.DEFLECTION, st.DEFLECTION_RATE}, {st.DISTAL_ANGLE, st.DISTAL_VELOCITY}
        reads |= output if rig.rigid_spring else spring
    rows = np.array(sorted(reads - {st.LOAD}), dtype=np.int64)
    matrix = np.array([read_row(rig, system.mechanics, int(r)) for r in rows]).reshape(len(rows), n)
    return Linear(
        phi=np.ascontiguousarray(exponential[:n, :n]), g=np.ascontiguousarray(exponential[:n, n:]),
        rows=rows, matrix=np.ascontiguousarray(matrix),
        spans=np.array([read_row(rig, system.mechanics, s) for s in (st.GEAR_VELOCITY, st.DEFLECTION)]),
        outputs=output_rows(rig, system.mechanics),
        outside=np.array([
            *(rig[f"{end}.{key}"] for key in ("gravity", "gravity_angle") for end in END_NAMES),
            rig["spring_end.stiffness"], rig["spring_end.damping"],
        ]),
        reads_load=reads_load, rest=(0.0,) * n,
    )


def start_map(m: Mechanics, encoder: FloatArray, spring: FloatArray | None = None) -> FloatArray:
    """Return the map from output angle (rad) and speed (rad/s) to the state of least energy, shape (2n, 2).

    An initial angle other than zero thus turns the free parts and does not load the spring. encoder: row of
    its angle in the state; spring: of F/T torque (N m) or deflection (rad), where that and its rate are known
    too, shape (2n, 4) then. Where the angle alone says all of the spring, as between clamped ends, its
    columns are zero.
    """
    n, rows = m.order, encoder[None, : m.order]
    start = np.zeros((2 * n, 2 if spring is None else 4))
    if not rows.any():
        return start
    if spring is not None:
        both = np.array([encoder[:n], spring[:n]])
        unit = both / np.maximum(np.linalg.norm(both, axis=1, keepdims=True), 1e-300)
        rows = both if np.linalg.matrix_rank(unit, tol=_ALIKE) == 2 else rows
    known = len(rows)
    start[n:, 1::2][:, :known] = _least(m.mass, rows)
    stiff = m.stiffness + 1e-9 * np.trace(m.stiffness + m.mass) * np.eye(n)
    start[:n, 0::2][:, :known] = level = _least(stiff, rows)
    if spring is not None and known == 2:
        start[:n] -= np.outer(level[:, 1], spring[n:] @ start[n:])
    return start


_ALIKE = 1e-6
"""Sine of the angle between the rows of two sensors that show the same."""


def _least(energy: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the map from readings of rows to what has them with the least of a quadratic energy."""
    along = np.linalg.solve(energy, rows.T)
    return np.asarray(along @ np.linalg.inv(rows @ along))


OUTPUT_ROWS = ("position", "velocity", "ft", "deflection")
"""What the rows of `Linear.outputs` show."""


def output_rows(rig: Rig, m: Mechanics) -> FloatArray:
    """Return OUTPUT_ROWS: position, velocity, the linear torque at the F/T sensor, and deflection."""
    position, velocity = encoder_row(rig, m), encoder_row(rig, m, is_rate=True)
    deflection, rate = (read_row(rig, m, s) for s in (st.DEFLECTION, st.DEFLECTION_RATE))
    if rig.ft_end == "housing_end":
        torque = _proximal_torque(rig, m)
    elif rig.rigid_spring:
        torque = np.zeros(2 * m.order)
    else:
        torque = _below(rig, m, rig["spring.stiffness"] * deflection + rig["spring.damping"] * rate)
    return np.array([position, velocity, torque, deflection])


def _below(rig: Rig, m: Mechanics, spring: FloatArray) -> FloatArray:
    """Return the row of T_s less the torque that the load above the sensor takes: part of its J q''.

    J q'' is T_s less the torque between load and ground.
    """
    share = rig["spring_end.above_sensor"]
    if share == 0.0:
        return spring
    angle, rate = (read_row(rig, m, s) for s in (st.DISTAL_ANGLE, st.DISTAL_VELOCITY))
    held = rig["spring_end.stiffness"] * angle + rig["spring_end.damping"] * rate
    return np.asarray((1.0 - share) * spring + share * held)


def _proximal_torque(rig: Rig, m: Mechanics) -> FloatArray:
    """Return the row of T_p = K_p (q_p - q_h) + b_p (q_p' - q_h'): a sensor at the housing's end reads it."""
    difference = np.array([-1.0, 0.0, 0.0, 0.0, 1.0]) @ m.placement
    stiffness, damping = rig["proximal_spring.stiffness"], rig["proximal_spring.damping"]
    return np.concatenate([stiffness * difference, damping * difference])
