"""Position loops: of a driver, and of a motor's firmware.

p, pd     u = k_p e + k_i int e dt - k_d q' + k_f r',   e = r - q; r follows its target within a speed
    mit       u = k_p e + k_d (r' - q') + u_f: a damped p loop with the target r + (k_d r' + u_f) / k_p
    cascade   v_r = k_pos e within a limit,   u = k_v (v_r - q') + k_vi int (v_r - q') dt

mit is the frame of CubeMars, Damiao, RobStride, CyberGear, the mini-cheetah and Unitree: target position,
target velocity (channel reference_velocity) and torque u_f (channel command) in every frame; gains constant.

The firmware uses the mean of the target since its last sample: the instant of a new target in it is unknown,
and a target that counted only at a sample would make every residual a staircase in the delay.
u is limited, held until the next sample, and added to the external command. An integral stands still
while u is at its limit and the error would drive it further (conditional integration; Astrom, Hagglund,
Advanced PID Control, 2006, section 3.5).
"""

import math
from dataclasses import replace

from rsea_ros.effects import signal_table as st
from rsea_ros.effects.effect import compiled
from rsea_ros.errors import ChannelError
from rsea_ros.model.rig import PositionLoop, Rig
from rsea_ros.records.record import Channel, ComplexArray, Record


def loop_parameters(rig: Rig) -> tuple[float, ...]:
    """Return the parameters of firmware_loop.control, in its order, of a rig that has a loop."""
    if rig.loop is None:
        c = rig.controller or PositionLoop(0.0, 0.0)
        return CASCADE, c.k_p, 0.0, c.k_v, 0.0, c.limit, math.inf, 0.0
    limits = tuple(rig[f"controller.{name}"] for name in ("torque_limit", "velocity_limit", "sample_time"))
    if rig.loop != "cascade":
        gains = tuple(rig[f"controller.{name}"] for name in ("k_p", "k_i", "k_d", "k_f"))
        return PD, *gains, *limits
    gains = tuple(rig[f"controller.{name}"] for name in ("k_pos", "k_vi", "k_v"))
    return CASCADE, *gains, 0.0, *limits


def with_command(record: Record, rig: Rig) -> Record:
    """Return the record with the signal that commands the rig as `command`: a position loop's targets, rad.

    Noise, blocks and responses then follow the targets. Raises ChannelError for a
    record without them, and for one that only positions commanded with another rig.
    """
    if rig.loop is None:
        if "command" not in record and "reference" in record:
            raise ChannelError(
                f"{record.source}: positions commanded this run, expected a rig with controller.kind; "
                f"{rig.name} is commanded with torques"
            )
        return record
    if "reference" not in record:
        have = ", ".join(record.channels) or "nothing"
        raise ChannelError(
            f"{record.source}: no target positions (channel reference, topic desired_position) beside "
            f"{have}, expected them: rig {rig.name} is commanded with positions"
        )
    if rig.loop == "mit" and FRAME not in record.notes:
        record = _with_one_target(record, rig)
    return record.with_channels(command=record["reference"])


FRAME = "the frames' target velocities and torques are in the target positions, over the gain k_p"
"""The note of a record of MIT frames whose three targets have become one."""


def _with_one_target(record: Record, rig: Rig) -> Record:
    """Return a record of MIT frames with the target positions that ask for the same torque."""
    target = record["reference"]
    beside = {"reference_velocity": rig["controller.k_d"], "command": 1.0}
    more = sum(k * record[n].held(target.t) for n, k in beside.items() if n in record)
    whole = Channel(target.t, target.y + more / rig["controller.k_p"])
    channels = {n: c for n, c in record.channels.items() if n not in beside}
    return replace(record, channels={**channels, "reference": whole}, notes=(*record.notes, FRAME))


def close_loop(rig: Rig, plant: ComplexArray, output: ComplexArray, s: ComplexArray) -> ComplexArray:
    """Return output / target with the loop closed, limits aside.

    plant: angle that the loop sees over motor torque; output: the output over motor torque; s: 2 pi i f, all
    of shape (n,). u = F r - B q, so output / r = output F / (1 + plant B).
    """
    _, position, integral, velocity, forward, *_ = loop_parameters(rig)
    if rig.loop != "cascade":
        ahead, back = position + integral / s + forward * s, position + integral / s + velocity * s
    else:
        inner = velocity + integral / s
        ahead, back = inner * position, inner * (position + s)
    return output * ahead / (1.0 + plant * back)


PD, CASCADE = 0.0, 1.0
STATES = 8
_KIND, _POSITION, _INTEGRAL, _VELOCITY, _FORWARD, _TORQUE_LIMIT, _VELOCITY_LIMIT, _SAMPLE = range(8)
_SUM, _HELD, _DUE, _TARGET, _ASKED, _STARTED, _TOTAL, _COUNT = range(STATES)


@compiled
def control(s, p, x):  # type: ignore[no-untyped-def]
    """Add the loop's torque. p: kind, three gains, feed-forward, limits of torque and speed, sample time."""
    h, r = s[st.STEP], s[st.REFERENCE]
    x[_TOTAL] += r
    x[_COUNT] += 1.0
    if x[_STARTED] == 0.0:
        x[_TARGET] = x[_ASKED] = r
        x[_DUE], x[_STARTED] = s[st.TIME], 1.0
    if s[st.TIME] + 0.5 * h > x[_DUE]:
        dt = max(p[_SAMPLE], h)
        x[_DUE] += dt
        r = x[_TOTAL] / x[_COUNT]
        x[_TOTAL] = x[_COUNT] = 0.0
        forward = p[_FORWARD] * (r - x[_ASKED]) / dt
        x[_ASKED] = r
        if p[_KIND] == PD:
            most = p[_VELOCITY_LIMIT] * dt
            x[_TARGET] += min(max(r - x[_TARGET], -most), most)
            error = x[_TARGET] - s[st.OUTPUT_ANGLE]
            u = p[_POSITION] * error - p[_VELOCITY] * s[st.OUTPUT_VELOCITY] + forward
        else:
            speed = p[_POSITION] * (r - s[st.OUTPUT_ANGLE])
            error = min(max(speed, -p[_VELOCITY_LIMIT]), p[_VELOCITY_LIMIT]) - s[st.OUTPUT_VELOCITY]
            u = p[_VELOCITY] * error
        u += p[_INTEGRAL] * x[_SUM]
        x[_HELD] = min(max(u, -p[_TORQUE_LIMIT]), p[_TORQUE_LIMIT])
        if u == x[_HELD] or math.copysign(1.0, error) != math.copysign(1.0, u):
            x[_SUM] += error * dt
    s[st.COMMAND] += x[_HELD]
    s[st.CURRENT] += x[_HELD]
