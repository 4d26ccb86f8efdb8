"""What ends the torque if the process dies: the motor's own watchdog, or a supervisor."""

import json
import math
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from rsea_ros.errors import DeviceError

SURE = 0.8
"""Share of the time-out from which on the supervisor may have acted."""
BEATS = 20
"""A time-out; a beat each cycle would wake the supervisor a thousand times a second."""
ANSWER, START = 1.0, 5.0
"""s that a supervisor may take to answer, or to end; to start as a child, on a busy machine."""
ECHO = 0.5
"""s without an echo after which a supervisor stands still: the driver has no guard."""
READY = b"ready\n"
SCRIPT = Path(__file__).with_name("supervisor.py")


class SupervisorLost(DeviceError):
    """The process that would stop the motor after the driver's death is dead itself."""


class HeldUp(DeviceError):
    """This process was stopped with torque on for about as long as the supervisor tolerates."""


class _End:
    """This end of the socket to a supervisor.

    That is a child, in a session of its own: it survives every signal to the driver's group. Or, with a path,
    a service at a Unix socket: it survives the group.
    """

    def __init__(self, path: str, descriptor: int, order: Mapping[str, object]) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        answer = b""
        try:
            if path:
                self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
                self._socket.settimeout(ANSWER)
                self._socket.connect(path)
            else:
                self._socket, far = socket.socketpair()
                with far:
                    self._process = subprocess.Popen(
                        [sys.executable, "-I", "-S", str(SCRIPT)], start_new_session=True,
                        stdin=far.fileno(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                    )  # fmt: skip
                self._socket.settimeout(START)
            socket.send_fds(self._socket, [json.dumps(order).encode() + b"\n"], [descriptor])
            answer = self._socket.recv(64)  # before it watches nothing may make torque
        except OSError as error:
            answer = str(error).encode()
        if answer != READY:
            self.close()
            where = f"parameter supervisor = {path!r}" if path else "supervisor process"
            raise SupervisorLost(
                f"{where}: {answer.decode() or 'no answer'}, expected a supervisor that listens there"
                " (docs/hardware.md)"
            )
        self._socket.settimeout(0.0)  # one that stands still is lost, and holds up no cycle

    def send(self, beat: bytes) -> None:
        """Send a beat. Raises OSError when nobody listens."""
        self._socket.send(beat)

    def heard(self) -> bool:
        """Return whether it has answered beats since the last call."""
        try:
            return self._socket.recv(4096) != b""
        except OSError:
            return False

    def alive(self) -> bool:
        """Return whether the supervisor runs, once all that it has answered is heard."""
        try:
            return self._socket.recv(1, socket.MSG_PEEK) != b""
        except BlockingIOError:
            return True
        except OSError:
            return False

    def close(self, patience: float = ANSWER) -> None:
        """End the connection, and wait until it has let the port go, which nobody else can open before."""
        self._socket.settimeout(patience)
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
            while self._socket.recv(4096):
                pass
        self._socket.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()


class Supervisor:
    """Sends `frames` on `descriptor` when this process ends, or does not beat for `timeout` s.

    replies: what acknowledges a frame: it is sent until then. Empty: nothing does.
    service: path of the Unix socket of one that runs apart; empty: a child process.
    """

    def __init__(
        self,
        descriptor: int,
        timeout: float,
        frames: Sequence[bytes],
        replies: Sequence[bytes] = (),
        service: str = "",
    ) -> None:
        self._timeout, self._last, self._beat, self._armed = timeout, 0.0, 0.0, False
        self._lost, self._unanswered = False, math.inf
        words = {"frames": [frame.hex() for frame in frames], "replies": [reply.hex() for reply in replies]}
        self._end = _End(service, descriptor, {"timeout": timeout, **words})

    def alive(self) -> bool:
        """Return whether it runs, and takes beats."""
        self._listen()
        return not self._lost and self._end.alive()

    def beat(self, armed: bool | None = None) -> None:
        """Report that this process runs, and whether torque is commanded (None: as before).

        A change of the torque is reported at once, otherwise the last report counts for a 20th of the
        time-out.
        Raises SupervisorLost, and HeldUp when the last beat is so old that the supervisor may have acted.
        """
        now = time.monotonic()
        gap, armed_before = now - self._last, self._armed
        self._last, self._armed = now, armed_before if armed is None else armed
        if self._armed != armed_before or now - self._beat > self._timeout / BEATS:
            self._beat = now
            self._tell(now)
        if armed_before and gap > SURE * self._timeout:
            limit = f"{1e3 * SURE * self._timeout:.0f} ms"
            raise HeldUp(f"no cycle for {1e3 * gap:.0f} ms, limit {limit}: the motor may have been stopped")

    def _listen(self) -> None:
        if self._end.heard():
            self._unanswered = math.inf

    def _tell(self, now: float) -> None:
        """Send a beat, and look for the echo of the last ones."""
        self._listen()
        self._unanswered, wrong = min(self._unanswered, now), ""
        if now - self._unanswered > ECHO:
            wrong = f"no answer for {now - self._unanswered:.2f} s, limit {ECHO:g} s"
        try:
            self._end.send(b"a" if self._armed else b"d")
        except OSError as error:
            wrong = error.strerror or f"{error}"
        if wrong:
            self._lost = True
            raise SupervisorLost(f"supervisor process: {wrong}, expected it to run")

    def close(self, *, safe: bool, patience: float) -> None:
        """End it in `patience`, s. safe: the motor has acknowledged zero torque; else its frames go out."""
        if safe:
            with suppress(OSError):
                self._end.send(b"q")
        self._end.close(patience)


BUS_WATCHDOG, SUPERVISOR, PROCESS, NONE = "bus watchdog", "supervisor", "process", "none"


class Protection:
    """Protection against a dead host that needs nothing done, or none.

    kind: BUS_WATCHDOG, the device's own; PROCESS, where the torque is the process's own, as of a simulation;
    NONE. within: s after the driver's last transaction until there is no torque.
    """

    def __init__(self, kind: str, within: float = math.nan) -> None:
        self._kind, self._within = kind, within

    @property
    def kind(self) -> str:
        """The present kind."""
        return self._kind

    def beat(self, armed: bool | None = None) -> None:
        """Report that the driver runs, and whether torque is commanded (None: as before)."""

    def __str__(self) -> str:
        return self.kind if math.isnan(self._within) else f"{self.kind}, {self._within:g} s"


class Supervised(Protection):
    """A supervisor process that sends frames to the device when the driver is dead or hangs.

    A device calls `guard` once its port is open, and `release` before it closes it; the beats are Guarded's.
    within: s. service: socket of a supervisor that runs as a service; empty: a child process.
    """

    def __init__(self, within: float, service: str = "") -> None:
        super().__init__(SUPERVISOR, within)
        self._service = service
        self._supervisor: Supervisor | None = None

    @property
    def kind(self) -> str:
        """SUPERVISOR between `guard` and `release`, else NONE."""
        return NONE if self._supervisor is None else SUPERVISOR

    def guard(self, descriptor: int, frames: Sequence[bytes], replies: Sequence[bytes] = ()) -> None:
        """Let a supervisor watch, a new one where the last is dead.

        frames: bytes that end the torque when they are written to the descriptor. replies: what the device
        sends to acknowledge one of them; the supervisor repeats it until then. Raises SupervisorLost.
        """
        if self._supervisor is not None and not self._supervisor.alive():
            self.release(safe=True)
        if self._supervisor is None:
            self._supervisor = Supervisor(descriptor, self._within, frames, replies, self._service)

    def beat(self, armed: bool | None = None) -> None:
        """Beat. Raises SupervisorLost, HeldUp."""
        if self._supervisor is not None:
            self._supervisor.beat(armed)

    def release(self, *, safe: bool, patience: float = ANSWER) -> None:
        """End the supervisor, see its `close`."""
        if self._supervisor is not None:
            self._supervisor.close(safe=safe, patience=patience)
            self._supervisor = None
