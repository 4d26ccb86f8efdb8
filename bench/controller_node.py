"""The controller node in a process of its own, with the instants at which it latches a fault written down.

SIGUSR1 holds its work up for HELD periods, again and again with RUNS between, until SIGUSR1 comes again: as a
busy machine does it, but by plan. SIGSTOP would not do: a subscriber that is stopped while it takes a message
out of shared memory holds up whoever publishes, here the driver, for a second.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

MARK, HOLD = "RSEA_BENCH_FAULTS", "RSEA_BENCH_HOLD"
HELD, RUNS = 8.0, 3.0
"""Periods for which it is held up, and for which it runs."""


class Hold:
    """Whether and when the work is held up. period: s."""

    def __init__(self, period: float) -> None:
        self._period, self._on, self._next = period, False, 0.0

    def toggle(self, number: int, frame: object) -> None:
        """Begin, or end."""
        self._on = not self._on

    def pause(self) -> None:
        """Hold the caller up when it is time to."""
        if self._on and time.monotonic() > self._next:
            time.sleep(HELD * self._period)
            self._next = time.monotonic() + RUNS * self._period


def main() -> int:
    """Run the node with a note of its faults: a line with ns of the monotonic clock and the fault each."""
    from rsea_ros.nodes import controller

    hold = Hold(float(os.environ[HOLD]))
    signal.signal(signal.SIGUSR1, hold.toggle)
    latch, work = controller.Controller._latch, controller.Controller._work

    def noted(self: controller.Controller, fault: str) -> None:
        now = time.monotonic_ns()
        latch(self, fault)
        with Path(os.environ[MARK]).open("a") as file:
            file.write(f"{now} {fault}\n")

    def held(self: controller.Controller) -> None:
        hold.pause()
        work(self)

    controller.Controller._latch = noted  # type: ignore[method-assign]
    controller.Controller._work = held  # type: ignore[method-assign]
    return controller.main()


if __name__ == "__main__":
    sys.exit(main())
