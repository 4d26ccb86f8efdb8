"""A position loop as a rig states it: parameters of the compiled step, and the closed-loop response."""

from __future__ import annotations

import math

from rsea_ros.errors import ChannelError
from rsea_ros.model import firmware_loop
from rsea_ros.model.rig import PositionLoop, Rig
from rsea_ros.records.record import ComplexArray, Record


def loop_parameters(rig: Rig) -> tuple[float, ...]:
    """Return the parameters of firmware_loop.control, in its order, of a rig that has a loop."""
    if rig.loop is None:
        c = rig.controller or PositionLoop(0.0, 0.0)
        return firmware_loop.CASCADE, c.k_p, 0.0, c.k_v, 0.0, c.limit, math.inf, 0.0
    limits = tuple(rig[f"controller.{name}"] for name in ("torque_limit", "velocity_limit", "sample_time"))
    if rig.loop == "pd":
        gains = tuple(rig[f"controller.{name}"] for name in ("k_p", "k_i", "k_d", "k_f"))
        return firmware_loop.PD, *gains, *limits
    gains = tuple(rig[f"controller.{name}"] for name in ("k_pos", "k_vi", "k_v"))
    return firmware_loop.CASCADE, *gains, 0.0, *limits


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
    return record.with_channels(command=record["reference"])


def close_loop(rig: Rig, plant: ComplexArray, output: ComplexArray, s: ComplexArray) -> ComplexArray:
    """Return output / target with the loop closed, limits aside.

    plant: angle that the loop sees over motor torque; output: the output over motor torque; s: 2 pi i f, all
    of shape (n,). u = F r - B q, so output / r = output F / (1 + plant B).
    """
    _, position, integral, velocity, forward, *_ = loop_parameters(rig)
    if rig.loop == "pd":
        ahead, back = position + integral / s + forward * s, position + integral / s + velocity * s
    else:
        inner = velocity + integral / s
        ahead, back = inner * position, inner * (position + s)
    result: ComplexArray = output * ahead / (1.0 + plant * back)
    return result
