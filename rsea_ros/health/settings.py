"""Settings of the watch over a joint."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WatchSettings:
    """rate: false alarms an hour. every: s between looks. learn: looks that show how the innovations scatter.

    fitted: looks that a cause is fitted to. hold: s, how long a command stays in force.
    """

    rate: float = 1e-3
    every: float = 3.0
    learn: int = 20
    fitted: int = 4
    hold: float = 0.05
