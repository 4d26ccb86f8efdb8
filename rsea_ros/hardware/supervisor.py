"""A process that outlives the driver: when that is gone or hangs, it sends the frames that stop the motor.

Run as a file of its own with nothing but the standard library:
supervisor.py DESCRIPTOR TIMEOUT_S FRAME_HEX… with the driver's beats on stdin: `a` torque is on, `d` it is
off, `q` all is well, end. End of input without `q` is the death of the driver, by whatever signal.
"""

from __future__ import annotations

import os
import select
import signal
import sys
import time

REPEAT, SPACING = 20, 0.005
"""How often the frames go out, and every how many s: one may collide with the motor's last answer."""


def send(descriptor: int, frames: list[bytes]) -> None:
    """Send every frame, one after the other with a pause for the motor's answer."""
    for frame in frames:
        try:
            os.write(descriptor, frame)
        except OSError:
            return
        time.sleep(SPACING / len(frames))


def watch(inlet: int, descriptor: int, timeout: float, frames: list[bytes]) -> None:
    """Follow the beats until they end."""
    armed = False
    while True:
        ready, _, _ = select.select((inlet,), (), (), timeout)
        if not ready:
            if armed:
                send(descriptor, frames)
            continue
        beats = os.read(inlet, 4096)
        if beats.endswith(b"q"):
            return
        if not beats:
            for _ in range(REPEAT):
                send(descriptor, frames)
            return
        armed = beats.endswith(b"a")


def main() -> None:
    """Watch the process at the other end of stdin; signals of the terminal are not meant for this one."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    descriptor, timeout, *frames = sys.argv[1:]
    watch(0, int(descriptor), float(timeout), [bytes.fromhex(text) for text in frames])


if __name__ == "__main__":
    main()
