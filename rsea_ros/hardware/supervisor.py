"""A process that outlives the driver: when the driver ends or hangs, it sends the frames that stop the motor.

Run as a file of its own with nothing but the standard library:
supervisor.py, with a Unix socket as stdin, gets {"timeout": S, "frames": [HEX, …], "replies": [HEX, …]} in a
line, with the descriptor of the port, and then the driver's beats: `a` torque is on, `d` it is off, `q` all
is well, end. End of input without `q` is the death of the driver, by whatever signal. Each beat is answered.
Frames go out again until the motor has acknowledged each with a reply, twice, where there are any; one that
does not is reported to the system log.
supervisor.py --listen SOCKET is the same as a service, for every driver that connects there, which survives
anything that kills driver and children together (a control group, a container, a login).
"""

import contextlib
import json
import os
import resource
import select
import signal
import socket
import sys
import syslog
import threading
import time

REPEAT, SPACING, SURE = 20, 0.005, 2
"""How often the frames go out, and every how many s: one may collide with the motor's last answer. Rounds
that must be acknowledged: answers are alike, and that last one may pass for the answer to the first frame."""
PATIENCE, HANG = 3.0, 0.1
"""s in which the motor of a dead driver, of one that hangs, may acknowledge them, as one that is booting."""


def hurry() -> None:
    """Run before all other processes where that is permitted, on any processor: a machine so busy that the
    driver hangs holds up this one, too."""
    with contextlib.suppress(OSError):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))


class Line:
    """The port of a motor. replies: what acknowledges a frame; none: nothing does."""

    def __init__(self, descriptor: int, frames: list[bytes], replies: list[bytes]) -> None:
        self._descriptor, self._frames, self._replies = descriptor, frames, replies

    def stop(self, again: int, patience: float = 0.0) -> bool:
        """Send all frames some times, then for so many s, until surely acknowledged; return whether."""
        end, rounds = time.monotonic() + patience, 0
        while True:
            done = [self._send(frame) for frame in self._frames]
            again, rounds = again - 1, rounds + 1 if all(done) else 0
            if rounds == SURE or (again <= 0 and time.monotonic() > end):
                return rounds == SURE

    def _send(self, frame: bytes) -> bool:
        """Send a frame and wait for its answer; return whether it is acknowledged."""
        end = time.monotonic() + SPACING / len(self._frames)
        heard = b""
        try:
            os.write(self._descriptor, frame)
            while (left := end - time.monotonic()) > 0.0:
                if not self._replies:
                    time.sleep(left)
                elif select.select((self._descriptor,), (), (), left)[0]:
                    data = os.read(self._descriptor, 4096)
                    if not data:
                        raise OSError("the port is gone")
                    heard += data
                    if any(reply in heard for reply in self._replies):
                        return True
        except OSError:
            time.sleep(max(0.0, end - time.monotonic()))
        return False


def watch(place: int, line: Line, timeout: float, *, acknowledged: bool) -> None:
    """Follow the beats until they end. acknowledged: whether the motor's answers are waited for."""
    armed = False
    while True:
        ready, _, _ = select.select((place,), (), (), timeout)
        if not ready:
            if armed:
                line.stop(1, min(timeout, HANG) if acknowledged else 0.0)
            continue
        try:
            beats = os.read(place, 4096)
        except OSError:  # a connection that was reset
            beats = b""
        if beats.endswith(b"q"):
            return
        if not beats:
            if not line.stop(REPEAT, PATIENCE if acknowledged else 0.0) and acknowledged:
                report("the driver has died, and the motor has not acknowledged zero torque: cut its supply")
            return
        with contextlib.suppress(OSError):  # nobody reads that any more
            os.write(place, b"e")
        armed = beats.endswith(b"a")


def report(text: str, urgency: int = syslog.LOG_CRIT) -> None:
    """Tell whoever can still be told."""
    syslog.syslog(urgency, f"rsea supervisor: {text}")
    with contextlib.suppress(OSError):
        os.write(2, f"supervisor: {text}\n".encode())


ORDER, SELECTED, OWN = 1.0, 1024, 10
"""s in which a connection must send an order, as long as a driver waits for the answer. Descriptors that
`select` takes; the service's own. A driver has two."""


def serve(connection: socket.socket) -> None:
    """Watch one driver over its connection until it is gone; what sends no order is no driver."""
    words, descriptors = b"", list[int]()
    with connection:
        try:
            words, descriptors, _, _ = socket.recv_fds(connection, 65536, 1)
            order = json.loads(words)
            frames, replies = (list(map(bytes.fromhex, order.get(n, []))) for n in ("frames", "replies"))
            line, timeout = Line(descriptors[0], frames, replies), float(order["timeout"])
            select.select((), (connection,), (), timeout)  # raises for what is no time
        except Exception as error:  # whatever a stranger sends
            if words:
                report(f"{len(words)} bytes that are no driver's order: {error}", syslog.LOG_WARNING)
        else:
            connection.settimeout(None)
            with contextlib.suppress(OSError):  # a driver that has died meanwhile
                connection.sendall(b"ready\n")
            watch(connection.fileno(), line, timeout, acknowledged=bool(replies))
        finally:
            for descriptor in descriptors:
                os.close(descriptor)


def listen(path: str) -> None:
    """Serve every driver that connects to a Unix socket, each in a thread, until a signal ends it.

    What it guards it guards on, whoever else comes: a connection for which there is no room is closed.
    """
    with contextlib.suppress(FileNotFoundError):
        os.unlink(path)
    most = (min(resource.getrlimit(resource.RLIMIT_NOFILE)[0], SELECTED) - OWN) // 2
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as place:
        place.bind(path)
        os.chmod(path, 0o660)
        place.listen()
        while True:
            try:
                connection = place.accept()[0]
            except OSError as error:
                report(f"no connection is accepted: {error}", syslog.LOG_WARNING)
                time.sleep(ORDER)
                continue
            connection.settimeout(ORDER)
            try:
                if threading.active_count() > most:
                    raise RuntimeError(f"there are {most}")
                threading.Thread(target=serve, args=(connection,), daemon=True).start()
            except RuntimeError as error:  # also where no thread can be started
                report(f"a connection is refused: {error}", syslog.LOG_WARNING)
                connection.close()


def main() -> None:
    """Watch the driver at the other end of stdin; signals of the terminal are not meant for this process."""
    hurry()
    if sys.argv[1:2] == ["--listen"]:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        return listen(sys.argv[2])
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    serve(socket.socket(fileno=0))


if __name__ == "__main__":
    main()
