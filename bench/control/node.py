"""The controller node in a process of its own, with the instants at which it latches a fault written down.

From SIGUSR1 on, until it comes again, HELD periods pass between taking measurements and commanding for them:
as on a busy machine, but at planned times. SIGSTOP is no substitute: a subscriber that is stopped while it
takes a message out of shared memory blocks the publisher, here the driver, for a second.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

MARK, HOLD = "RSEA_BENCH_FAULTS", "RSEA_BENCH_HOLD"
HELD = 4.0


class Hold:
    """Delay of the node's work. period: s."""

    def __init__(self, period: float) -> None:
        self._period, self._on = period, False

    def toggle(self, number: int, frame: object) -> None:
        """Begin or end the delay."""
        self._on = not self._on

    def pause(self) -> None:
        """Delay the caller."""
        if self._on:
            time.sleep(HELD * self._period)


def main() -> int:
    """Run the node with a note of its faults: a line with ns of the monotonic clock and the fault each."""
    from rsea_ros.control.controller import Measurement
    from rsea_ros.nodes import controller

    hold = Hold(float(os.environ[HOLD]))
    signal.signal(signal.SIGUSR1, hold.toggle)
    latch, take = controller.ControllerNode._latch, controller.Measurements.take

    def note(self: controller.ControllerNode, fault: str) -> None:
        now = time.monotonic_ns()
        latch(self, fault)
        with Path(os.environ[MARK]).open("a") as file:
            file.write(f"{now} {fault}\n")

    def held(self: controller.Measurements) -> Iterator[tuple[int, Measurement]]:
        arrived = list(take(self))
        if arrived:
            hold.pause()
        return iter(arrived)

    controller.ControllerNode._latch = note  # type: ignore[method-assign]
    controller.Measurements.take = held  # type: ignore[method-assign]
    return controller.main()


if __name__ == "__main__":
    sys.exit(main())
