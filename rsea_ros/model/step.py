"""One step of the simulation, compiled.

The linear part x' = A x + B tau is integrated by its matrix exponential, with the torques of the step held
(the exponential midpoint rule: Hochbruck and Ostermann, Acta Numerica 19, 2010, section 2):

    x_next = e^{A h} x + G (u + f),   G = int_0^h e^{A s} ds B

u is the motor torque held over the step, f the torques of the effects at the five ports, taken in the middle
between x and an x_next predicted with the last step's f: one evaluation a step, and second order still.
Friction takes its mean over the step instead (effects/_friction.py).
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.cpython.unsafe.tuple import tuple_setitem
from numba.extending import intrinsic

from rsea_ros.compiler import njit
from rsea_ros.effects import signal_table as st
from rsea_ros.effects._held import put_beside
from rsea_ros.records.record import FloatArray, IntArray


@intrinsic
def call(typingctx: Any, address: Any, s: Any, p: Any, x: Any) -> Any:
    """Call `void f(double*, double*, double*)` at an address with three addresses, all given as integers."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double_pointer = ir.DoubleType().as_pointer()
        function = ir.FunctionType(ir.VoidType(), [double_pointer] * 3).as_pointer()
        target = builder.inttoptr(arguments[0], function)
        builder.call(target, [builder.inttoptr(a, double_pointer) for a in arguments[1:]])
        return context.get_dummy_value()

    return types.void(types.intp, types.intp, types.intp, types.intp), generate


OUTPUTS = ("position", "velocity", "motor_torque", "ft", "deflection")

_COMMAND, _MOTOR, _GEAR, _SPRING, _SENSOR = (int(port) for port in st.Port if port != st.Port.STRUCTURE)
_FORCES = 5


class Linear(NamedTuple):
    """Propagators of one step and the rows that read the state x (order n).

    phi (n, n), g (n, 5); rows: signals that are read, matrix (rows, n) reads them; spans (2, n): gear
    velocity and deflection; outputs (4, n): position, velocity, the linear torque at the F/T sensor and
    deflection; outside (6,): m g l of the ends, N m, how far from hanging each is at angle zero, rad, then
    stiffness and damping of what the spring's end stands against, N m/rad and N m s/rad.
    rest: n zeros. The step is compiled for each length of it, and keeps the state in registers.
    """

    phi: FloatArray
    g: FloatArray
    rows: IntArray
    matrix: FloatArray
    spans: FloatArray
    outputs: FloatArray
    outside: FloatArray
    reads_load: bool
    rest: tuple[float, ...]


class Calls(NamedTuple):
    """The effects that are on, in the order of their ports.

    first[port] … first[port + 1] are those of a port; p_at and x_at say where their parameters and states
    begin. nonlinear: whether any effect adds torques.
    """

    first: IntArray
    address: IntArray
    p_at: IntArray
    x_at: IntArray
    p: FloatArray
    nonlinear: bool


class StepInputs(NamedTuple):
    """What drives a run of steps.

    command: N m, held over each step. reference: rad, target of a position loop; ridden: rad, measured rotor
    angle at the middle of each step; both may be empty. start: time of the first step, s. jumps: the command
    is held between its stamps. within: HELD of each step and zeros, shape (steps, 4), or (0, 4); where
    an effect changes it, or the command changes within the step, it gets HELD, BEFORE, AFTER, CURRENT_BEFORE.
    """

    command: FloatArray
    reference: FloatArray
    ridden: FloatArray
    start: float
    jumps: bool
    within: FloatArray


class StepState(NamedTuple):
    """What a run of steps changes in place: state x of the mechanics, signal table, states of the effects."""

    x: FloatArray
    table: FloatArray
    effect_x: FloatArray


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def call_port(port, calls, s_at, p_at, effect_x_at):  # type: ignore[no-untyped-def]
    for i in range(calls.first[port], calls.first[port + 1]):
        call(calls.address[i], s_at, p_at + 8 * calls.p_at[i], effect_x_at + 8 * calls.x_at[i])  # type: ignore[call-arg]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _dot(matrix, row, x):  # type: ignore[no-untyped-def]
    """Return a row of a matrix times x; a view of the row would be counted, which costs more than this."""
    value = 0.0
    for j in range(len(x)):
        value += matrix[row, j] * x[j]
    return value


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _state(x, rest):  # type: ignore[no-untyped-def]
    """Return an array as a tuple of the length of `rest`."""
    state = rest
    for i in range(len(rest)):
        state = tuple_setitem(state, i, x[i])  # type: ignore[call-arg]
    return state


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _free(linear, u, x):  # type: ignore[no-untyped-def]
    """Return the state after a step in which the motor torque u alone acts."""
    end = x
    for i in range(len(x)):
        end = tuple_setitem(end, i, linear.g[i, 0] * u + _dot(linear.phi, i, x))  # type: ignore[call-arg]
    return end


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _with_torques(linear, s, x):  # type: ignore[no-untyped-def]
    """Return the state at the end of a step with the torques of the effects."""
    for j in range(_FORCES):
        torque = s[st.FIRST_FORCE + j]
        if torque != 0.0:
            for i in range(len(x)):
                x = tuple_setitem(x, i, x[i] + linear.g[i, j] * torque)  # type: ignore[call-arg]
    return x


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _middle(a, b):  # type: ignore[no-untyped-def]
    middle = a
    for i in range(len(a)):
        middle = tuple_setitem(middle, i, 0.5 * (a[i] + b[i]))  # type: ignore[call-arg]
    return middle


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _read(linear, x, s):  # type: ignore[no-untyped-def]
    """Put the signals that effects look at into the table, and clear the torques."""
    for r in range(len(linear.rows)):
        s[linear.rows[r]] = _dot(linear.matrix, r, x)
    if linear.reads_load and s[st.K_S] != 0.0:
        s[st.LOAD] = s[st.K_S] * s[st.DEFLECTION] + s[st.B_S] * s[st.DEFLECTION_RATE] + s[st.SPRING_TORQUE]
    for i in range(_FORCES):
        s[st.FIRST_FORCE + i] = 0.0
    if linear.outside[0] != 0.0:
        s[st.HOUSING_TORQUE] = -linear.outside[0] * np.sin(s[st.HOUSING_ANGLE] + linear.outside[2])
    if linear.outside[1] != 0.0:
        s[st.DISTAL_TORQUE] = -linear.outside[1] * np.sin(s[st.DISTAL_ANGLE] + linear.outside[3])
    if linear.reads_load and s[st.K_S] == 0.0:
        held = linear.outside[4] * s[st.DISTAL_ANGLE] + linear.outside[5] * s[st.DISTAL_VELOCITY]
        s[st.LOAD] = held - s[st.DISTAL_TORQUE]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _read_outputs(linear, x, s):  # type: ignore[no-untyped-def]
    """Put the readings of the nominal actuator's sensors into the table."""
    s[st.POSITION] = s[st.OUTPUT_ANGLE] = _dot(linear.outputs, 0, x)
    s[st.VELOCITY] = s[st.OUTPUT_VELOCITY] = _dot(linear.outputs, 1, x)
    s[st.FT] = _dot(linear.outputs, 2, x) + s[st.SENSED] * s[st.SPRING_TORQUE]
    s[st.SPRING_ANGLE] = _dot(linear.outputs, 3, x) + s[st.PLAY]


@njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
def advance(linear, calls, inputs, state, out):  # type: ignore[no-untyped-def]
    """Run the steps of `inputs.command`, in place; out (steps, 5): OUTPUTS at the end of each step.

    Without numba's counted references (_nrt): a count is an atomic addition, and took half of a step.
    """
    command, reference, ridden, start, jumps, within = inputs
    s, effect_x = state.table, state.effect_x
    h, x = s[st.STEP], _state(state.x, linear.rest)
    s_at, p_at, effect_x_at = s.ctypes.data, calls.p.ctypes.data, effect_x.ctypes.data
    last, is_kept = len(command) - 1, len(within) > 0
    for k in range(last + 1):
        s[st.TIME], s[st.COMMAND], s[st.CURRENT] = start + k * h, command[k], command[k]
        if jumps:
            put_beside(s, command[max(k - 1, 0)], command[min(k + 1, last)])
        if len(reference) > 0:
            s[st.REFERENCE] = reference[k]
        if is_kept:
            s[st.HELD] = within[k, 0]
        call_port(_COMMAND, calls, s_at, p_at, effect_x_at)
        call_port(_MOTOR, calls, s_at, p_at, effect_x_at)
        if is_kept and (s[st.BEFORE] != s[st.AFTER] or s[st.HELD] != within[k, 0]):
            within[k, 0], within[k, 1] = s[st.HELD], s[st.BEFORE]
            within[k, 2], within[k, 3] = s[st.AFTER], s[st.CURRENT_BEFORE]
        free = end = _free(linear, s[st.COMMAND], x)
        if calls.nonlinear:
            s[st.TIME], s[st.COMMIT] = start + (k + 0.5) * h, 0.0
            end = _with_torques(linear, s, free)
            s[st.GEAR_VELOCITY_SPAN] = _dot(linear.spans, 0, end) - _dot(linear.spans, 0, x)
            s[st.DEFLECTION_SPAN] = _dot(linear.spans, 1, end) - _dot(linear.spans, 1, x)
            _read(linear, _middle(x, end), s)
            if len(ridden) > 0:
                s[st.ROTOR_ANGLE] = ridden[k]
            call_port(_GEAR, calls, s_at, p_at, effect_x_at)
            call_port(_SPRING, calls, s_at, p_at, effect_x_at)
            end = _with_torques(linear, s, free)
        x = end
        s[st.TIME] = start + (k + 1) * h
        if calls.first[_SPRING] < calls.first[_SPRING + 1]:
            held = s[st.GEAR_TORQUE], s[st.JOINT_TORQUE], s[st.HOUSING_TORQUE], s[st.DISTAL_TORQUE]
            s[st.COMMIT], s[st.DEFLECTION_SPAN] = 1.0, 0.0
            _read(linear, x, s)
            call_port(_SPRING, calls, s_at, p_at, effect_x_at)
            s[st.GEAR_TORQUE], s[st.JOINT_TORQUE], s[st.HOUSING_TORQUE], s[st.DISTAL_TORQUE] = held
        _read_outputs(linear, x, s)
        call_port(_SENSOR, calls, s_at, p_at, effect_x_at)
        out[k, 0], out[k, 1], out[k, 2] = s[st.POSITION], s[st.VELOCITY], s[st.CURRENT]
        out[k, 3], out[k, 4] = s[st.FT], s[st.SPRING_ANGLE]
    s[st.BEFORE] = s[st.AFTER] = 0.0
    for i in range(len(x)):
        state.x[i] = x[i]
