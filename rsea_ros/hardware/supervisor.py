"""A process that outlives the driver: when the driver ends or hangs, it sends the frames that stop the motor.

Run as a file of its own with nothing but the standard library:
supervisor.py DESCRIPTOR TIMEOUT_S FRAME_HEX… with the driver's beats on stdin: `a` torque is on, `d` it is
off, `q` all is well, end. End of input without `q` is the death of the driver, by whatever signal.
supervisor.py --listen SOCKET is the same as a service, which survives anything that kills driver and children
together (a control group, a container, a login): a driver connects to the Unix socket, sends a line
{"timeout": S, "frames": [HEX, …]} with the descriptor of its port, and its beats.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import socket
import sys
import threading
import time

REPEAT, SPACING = 20, 0.005
"""How often the frames go out, and every how many s: one may collide with the motor's last answer."""


def hurry() -> None:
    """Run before all other processes where that is permitted, on any processor: a machine so busy that the
    driver hangs holds up this one, too."""
    with contextlib.suppress(OSError):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))


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
        try:
            beats = os.read(inlet, 4096)
        except OSError:  # a connection that was reset
            beats = b""
        if beats.endswith(b"q"):
            return
        if not beats:
            for _ in range(REPEAT):
                send(descriptor, frames)
            return
        armed = beats.endswith(b"a")


def serve(connection: socket.socket) -> None:
    """Watch one driver over its connection until it is gone."""
    with connection:
        line, (descriptor, *_), _, _ = socket.recv_fds(connection, 65536, 1)
        order = json.loads(line)
        connection.sendall(b"ready\n")
        try:
            frames = [bytes.fromhex(text) for text in order["frames"]]
            watch(connection.fileno(), descriptor, float(order["timeout"]), frames)
        finally:
            os.close(descriptor)


def listen(path: str) -> None:
    """Serve every driver that connects to a Unix socket, each in a thread, until a signal ends it."""
    with contextlib.suppress(FileNotFoundError):
        os.unlink(path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as place:
        place.bind(path)
        os.chmod(path, 0o660)
        place.listen()
        while True:
            threading.Thread(target=serve, args=(place.accept()[0],), daemon=True).start()


def main() -> None:
    """Watch the process at the other end of stdin; signals of the terminal are not meant for this one."""
    hurry()
    if sys.argv[1:2] == ["--listen"]:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        return listen(sys.argv[2])
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    descriptor, timeout, *frames = sys.argv[1:]
    watch(0, int(descriptor), float(timeout), [bytes.fromhex(text) for text in frames])


if __name__ == "__main__":
    main()
