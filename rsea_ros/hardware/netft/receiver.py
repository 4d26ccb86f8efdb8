"""Drains the socket on request and in a thread: every record has the stamp of its arrival.

RDT: requests, records of 36 bytes, and lost records by their counters.
"""

import contextlib
import socket
import struct
import threading
import time
from collections import Counter, deque
from typing import NamedTuple

from rsea_ros.errors import DeviceError

STOP, STREAM, RESET_LATCH, SET_BIAS = 0, 2, 0x41, 0x42
SIZE = 36
_RECORD = struct.Struct(">III6i")
_REQUEST = struct.Struct(">HHI")
_WORD = 1 << 32
ERROR = 0x8000_0000
SATURATION = 0x0002_0000
LATCHED = 0x8001_0000
LONGEST_GAP = 1 << 20
"""Records; a larger step forward is damage, not a gap (150 s at 7 kHz)."""
REORDERED = 64
"""Records; so far back is a datagram that was overtaken, further back another stream."""
RESYNCHRONISE = 4
"""Consecutive records that are believed against those before."""


class RdtRecord(NamedTuple):
    """One record: counters, status bits, counts of force x, y, z and torque x, y, z."""

    sequence: int
    ft_sequence: int
    status: int
    counts: tuple[int, ...]


def request(command: int, count: int = 0) -> bytes:
    """Return a request; count: requested records, 0 without end."""
    return _REQUEST.pack(0x1234, command, count)


def decode(datagram: bytes) -> RdtRecord | None:
    """Return the record of a datagram; None for another datagram."""
    if len(datagram) != SIZE:
        return None
    sequence, ft_sequence, status, *counts = _RECORD.unpack(datagram)
    return RdtRecord(sequence, ft_sequence, status, tuple(counts))


def trouble(status: int) -> str:
    """Return the error in the status bits: '' none, `saturation` or `status`.

    0x80010000 alone is the condition latch, the memory of an earlier crossing, not an error.
    """
    if status & SATURATION:
        return "saturation"
    return "status" if status & ERROR and status != LATCHED else ""


class Sequence:
    """Follows the counters of one stream.

    counts: `received`, `lost`, `duplicate`, `reordered`, `damaged` (a step that no stream makes), `frozen`
    (the sensor's own counter stands still), `restarted` (it went back: the sensor was switched off),
    `resynchronised` (records that fit each other, not those before: they are another stream).
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._rdt: int | None = None
        self._ft: int | None = None
        self._stray: tuple[int, int] | None = None
        self._strays = 0

    def begin(self) -> None:
        """A new stream was requested: rdt_sequence restarts, the sensor's own counter continues."""
        self._rdt = None

    def forget(self) -> None:
        """Accept the next record whatever its counters."""
        self._rdt = self._ft = None

    def accept(self, record: RdtRecord) -> bool:
        """Count a record; return whether it is newer than all before and may be used."""
        step = 1 if self._rdt is None else (record.sequence - self._rdt) % _WORD
        ft_step = 1 if self._ft is None else (record.ft_sequence - self._ft) % _WORD
        anew = "restarted" if record.ft_sequence < LONGEST_GAP else "damaged"  # near zero: it was off
        kind = "duplicate" if step == 0 else _kind(step) or _kind(ft_step, anew)
        if kind and kind != "restarted" and self._another_stream(record):
            self.counts["resynchronised"] += 1
            step, ft_step, kind = 1, 1, ""
        if kind:
            self.counts[kind] += 1
            if kind == "restarted":
                self._rdt, self._ft = record.sequence, record.ft_sequence
            return False
        self.counts["lost"] += step - 1
        self.counts["received"] += 1
        self.counts["frozen"] += ft_step == 0
        self._rdt, self._ft = record.sequence, record.ft_sequence
        self._stray, self._strays = None, 0
        return True

    def _another_stream(self, record: RdtRecord) -> bool:
        """Return whether the last few records that did not fit follow each other."""
        follows = False
        if self._stray is not None:
            step, ft_step = ((new - old) % _WORD for new, old in zip(record[:2], self._stray, strict=True))
            follows = step == 1 and ft_step < LONGEST_GAP
        self._strays = self._strays + 1 if follows else 1
        self._stray = (record.sequence, record.ft_sequence)
        return self._strays >= RESYNCHRONISE


def _kind(step: int, far: str = "damaged") -> str:
    """Return the fault in a step of a counter, `far` in one that no gap makes; '' for none and for a gap."""
    if step < LONGEST_GAP:
        return ""
    return "reordered" if _WORD - step <= REORDERED else far


SO_TIMESTAMPNS = 35
"""Linux: the kernel stamps a datagram on arrival, however late the thread comes to fetch it."""
_STAMP = struct.Struct("@qq")
ANCILLARY = socket.CMSG_SPACE(_STAMP.size)
PAUSE, HELD = 0.01, 256
"""s between two looks of the thread; records that the kernel holds. A drain that takes more may never end."""
ASK_AGAIN = 0.2
"""s of silence after which the stream is asked for again."""
KEPT = 4096
LONGEST_AGO = 1_000_000_000
"""ns; so long no datagram waits for the thread."""
STAMPING = 100
"""Tries, of 1 ms each."""


class Arrival(NamedTuple):
    """A record and when it arrived: stamp by the system clock, ns since the epoch; instant: monotonic, ns."""

    stamp: int
    record: RdtRecord
    instant: int


class DatagramReceiver:
    """Request the stream of a sensor and keep its records.

    sequence: counts of received and lost records. refused: datagrams that were not records.
    """

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self.sequence = Sequence()
        self.refused: Counter[str] = Counter()
        self._waiting: deque[Arrival] = deque(maxlen=KEPT)
        self._aside: deque[Arrival] | None = None
        self.newest: Arrival | None = None
        self._heard = 0.0
        self._draining = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self) -> None:
        """Request the stream and begin to receive. Raises DeviceError."""
        try:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            self._socket.connect(self._address)  # from nobody else
            _until_stamped()
            self._socket.send(request(STREAM))
        except OSError as error:
            raise DeviceError(f"F/T sensor {self._address[0]}:{self._address[1]}: {error}") from None
        self.sequence.forget()
        self.newest = None
        self._stop.clear()
        self._thread = threading.Thread(target=self._run, name="netft", daemon=True)
        self._thread.start()

    def send(self, command: int) -> None:
        """Send a command, then request the stream again."""
        with contextlib.suppress(OSError):
            self._socket.send(request(command))
            self.sequence.begin()
            self._socket.send(request(STREAM))

    def take(self) -> list[Arrival]:
        """Return the records that have come since the last call, oldest first."""
        self.drain()
        taken = []
        with contextlib.suppress(IndexError):
            while True:
                taken.append(self._waiting.popleft())
        return taken

    def collect(self, seconds: float) -> list[Arrival]:
        """Return the records of the next seconds, in addition to those that `take` gives to a cycle."""
        self.drain()
        aside: deque[Arrival] = deque(maxlen=KEPT)
        self._aside = aside
        time.sleep(seconds)
        self.drain()
        self._aside = None
        return list(aside)

    def close(self) -> None:
        """Stop the stream and the thread."""
        self._stop.set()
        if self._thread is not None:
            with contextlib.suppress(OSError):
                self._socket.send(request(STOP))
            self._thread.join()
            self._socket.close()
            self._thread = None

    def _run(self) -> None:
        """Drain the socket between calls, and repeat the request when nothing comes."""
        asked = time.monotonic()
        while not self._stop.is_set():
            time.sleep(PAUSE)  # by the steady clock, unlike a wait for the event in Python 3.10
            self.drain()
            if time.monotonic() - max(asked, self._heard) > ASK_AGAIN:
                self.send(STREAM)
                asked = time.monotonic()

    def drain(self) -> None:
        """Keep all that has come, unless the other thread is at it."""
        if self._thread is None or not self._draining.acquire(blocking=False):
            return
        try:
            with contextlib.suppress(OSError):  # no more records, or the sensor is off
                for _ in range(HELD):
                    self._keep(*self._socket.recvmsg(SIZE_AND_MORE, ANCILLARY, socket.MSG_DONTWAIT))
        finally:
            self._draining.release()

    def _keep(self, data: bytes, ancillary: list[tuple[int, int, bytes]], flags: int, sender: object) -> None:
        self._heard = time.monotonic()
        record = decode(data)
        if record is None:
            self.refused["length"] += 1
        elif self.sequence.accept(record):
            stamp = _arrival_stamp(ancillary)
            arrival = Arrival(stamp, record, _monotonic(stamp))
            self._waiting.append(arrival)
            if (aside := self._aside) is not None:
                aside.append(arrival)
            self.newest = arrival


SIZE_AND_MORE = 64
"""Bytes asked of the socket: more than a record, so that one which is too long is seen to be."""


def _until_stamped() -> None:
    """Wait until the kernel stamps what arrives: it begins some ms after it was asked to, and gives the time
    of fetching until then. A datagram that is fetched a while after it was sent shows it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        probe.bind(("127.0.0.1", 0))
        probe.connect(probe.getsockname())
        for _ in range(STAMPING):
            probe.send(b"")
            sent = time.time_ns()
            time.sleep(1e-3)
            if _arrival_stamp(probe.recvmsg(1, ANCILLARY)[1]) <= sent:
                return


def _monotonic(stamp: int) -> int:
    """Return a stamp of just now on the monotonic clock; now where the system clock was set since."""
    now, ago = time.monotonic_ns(), time.time_ns() - stamp
    return now - ago if 0 <= ago <= LONGEST_AGO else now


def _arrival_stamp(ancillary: list[tuple[int, int, bytes]]) -> int:
    """Return the kernel's stamp of a datagram, ns; now when it has none."""
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS and len(data) >= _STAMP.size:
            seconds, nanoseconds = _STAMP.unpack(data[: _STAMP.size])
            return int(seconds) * 1_000_000_000 + int(nanoseconds)
    return time.time_ns()
