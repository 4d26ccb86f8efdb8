"""Where a motor is and how it is driven."""

from __future__ import annotations

from dataclasses import dataclass

SHARE, REST = 0.4, 1e-4
"""What a reply may be late: part of a cycle, less so many s, half of what the rest of a cycle takes."""


@dataclass(frozen=True)
class MotorConnection:
    """Connection and model of the motor.

    baud: bit/s. model: number that is expected, 0 for any known. torque_constant: N m at the gear output
    per A, 0: that of the model's table. latency: allowance for adapter and scheduler beside the time on the
    wire, s; a reading may also use what the write before it has left. watchdog: s without the host after
    which the motor's own watchdog, or the supervisor, takes the torque away. supervisor: socket of one that
    runs as a service; empty: a child of this process.
    """

    path: str
    baud: int = 1_000_000
    identity: int = 1
    model: int = 0
    torque_constant: float = 0.0
    latency: float = 1e-3
    watchdog: float = 0.1
    supervisor: str = ""


def usual_latency(rate: float, replies: int = 2) -> float:
    """Return the latency (s) with which a cycle that loses all its replies still ends in time. rate: Hz."""
    return max(2.0 * SHARE / replies / rate - REST, REST)
