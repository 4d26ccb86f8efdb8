"""A simulated F/T sensor, and how it misbehaves."""

import operator
import random
import socket
import struct
import threading
from collections import deque
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from rsea_ros.hardware.peer.peer_motor import Mechanism

HEAD, EQUAL = 9, 14
"""Bytes of a reply before its data; the longest, that of a ping, which two motors of one model send alike."""


@dataclass
class Misbehaviour:
    """drop, delay, corrupt, truncate, wrong_crc: shares of the motor's replies. late: of the delay, s.
    unstuffed, silent: whether. twin: whether a second motor of the same ID answers at the same time, with
    other measurements; a line that two drive is low where either is. ft_drop: share of the sensor's records;
    ft_silent: whether it sends none; ft_stuck: whether they repeat one value, while the counters go on.
    """

    drop: float = 0.0
    delay: float = 0.0
    late: float = 0.01
    corrupt: float = 0.0
    truncate: float = 0.0
    wrong_crc: float = 0.0
    unstuffed: bool = False
    silent: bool = False
    twin: bool = False
    ft_drop: float = 0.0
    ft_silent: bool = False
    ft_stuck: bool = False
    seed: int = 0
    done: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)

    def happens(self, kind: str) -> bool:
        """Draw for a share or read a switch, and count the event."""
        setting = getattr(self, kind)
        if setting is False or setting == 0.0:
            return False
        if setting is True or self._random.random() < setting:
            self.done[kind] = self.done.get(kind, 0) + 1
            return True
        return False

    def damage(self, packet: bytes) -> bytes:
        """Return a reply as it goes onto the wire: empty when it is dropped."""
        if self.happens("silent") or self.happens("drop"):
            return b""
        if len(packet) > EQUAL and self.happens("twin"):
            twin = bytes(37 * at % 256 for at in range(len(packet) - HEAD))
            packet = packet[:HEAD] + bytes(map(operator.and_, packet[HEAD:], twin))
        if self.happens("wrong_crc"):
            packet = packet[:-1] + bytes((packet[-1] ^ 0x5A,))
        if self.happens("corrupt"):
            at = self._random.randrange(len(packet))
            packet = packet[:at] + bytes((packet[at] ^ (1 << self._random.randrange(8)),)) + packet[at + 1 :]
        if self.happens("truncate"):
            packet = packet[: self._random.randrange(1, len(packet))]
        return packet


WORDS = struct.Struct(">9I")
RECORDS = 500_000
"""Records of the log, where somebody watches: a minute at 7 kHz."""
STOP, STREAM, BUFFERED, RESET_LATCH, SET_BIAS = 0, 2, 3, 0x41, 0x42
SATURATED = 0x8002_0000
COUNTS_PER_NEWTON, COUNTS_PER_NEWTON_MILLIMETRE = 1_000_000, 1_000
PAGE = f"""<?xml version="1.0"?>
<netft><prodname>Net F/T</prodname><calsn>FT00000</calsn><cfgnam>bench</cfgnam>
<cfgcpf>{COUNTS_PER_NEWTON}</cfgcpf><cfgcpt>{COUNTS_PER_NEWTON_MILLIMETRE}</cfgcpt>
<cfgmr>2800;2800;6800;120000;120000;120000</cfgmr>
<scfgfu>N</scfgfu><scfgtu>N-mm</scfgtu><comrdtrate>{{rate}}</comrdtrate>
<setuserfilter>0</setuserfilter></netft>
"""


class ForceSensor:
    """Streams records at `rate` (Hz) to the last client that asked. gone: records that were left out.

    sign: −1 where all six values are reversed.
    """

    def __init__(self, plant: Mechanism, rate: float, wrong: Misbehaviour, host: str = "127.0.0.1") -> None:
        self._plant, self._wrong = plant, wrong
        self._period = round(1e9 / rate)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        self.socket.bind((host, 0))
        self.socket.setblocking(False)
        self.descriptor = self.socket.fileno()
        self.port = self.socket.getsockname()[1]
        self._client: tuple[str, int] | None = None
        self._left: int | None = None
        self._rdt, self._ft, self.status = 0, 0, 0
        self._bias, self._counts = [0] * 6, [0] * 6
        self._due = 0
        self.gone, self.sign = 0, 1
        self.keep = False
        self.sent: deque[tuple[int, tuple[int, ...]]] = deque(maxlen=RECORDS)
        self.page = _serve_page(host, PAGE.format(rate=round(rate)))

    @property
    def next_due(self) -> int | None:
        """When the next record goes out, ns; None when nobody asks."""
        return self._due if self._client else None

    def serve(self, now: int) -> None:
        """Take requests."""
        while True:
            try:
                request, client = self.socket.recvfrom(64)
            except OSError:
                return
            if len(request) == 8 and request[0] == 0x12 and request[1] == 0x34:
                command, count = int.from_bytes(request[2:4], "big"), int.from_bytes(request[4:], "big")
                self._obey(now, client, command, count)

    def _obey(self, now: int, client: tuple[str, int], command: int, count: int) -> None:
        if command in (STREAM, BUFFERED):
            self._client, self._left, self._rdt = client, count or None, 0
            self._due = now
        elif command == STOP:
            self._client = None
        elif command == SET_BIAS:
            self._bias = list(self._counts)
        elif command == RESET_LATCH:
            self.status = 0 if self.status == 0x8001_0000 else self.status

    def tick(self, now: int) -> bool:
        """Send all records that are due; return whether there were any, the plant then being up to date."""
        due = self._client is not None and self._due <= now
        while self._client and self._due <= now:
            self._due += self._period
            counts = [self.sign * count for count in _counts(self._plant)]
            self._counts = self._counts if self._wrong.happens("ft_stuck") else counts
            self._ft = (self._ft + 1) % (1 << 32)
            self._rdt = (self._rdt + 1) % (1 << 32)
            if self._wrong.happens("ft_silent"):
                continue
            if self._wrong.happens("ft_drop"):
                self.gone += 1
                continue
            self._send(now)
        return due

    def gap(self, records: int) -> None:
        """Leave out so many records at once."""
        self._rdt, self._ft = self._rdt + records, self._ft + records
        self.gone += records

    def set_rate(self, rate: float) -> None:
        """Send so many records a second (Hz) from now on; the page is that of before, as at its settings."""
        self._period = round(1e9 / rate)

    def restart(self) -> None:
        """Switch the box off and on: nobody listens, the counters and the bias are gone."""
        self._client, self._rdt, self._ft, self._bias = None, 0, 0, [0] * 6

    def _send(self, now: int) -> None:
        values = tuple(c - b for c, b in zip(self._counts, self._bias, strict=True))
        record = WORDS.pack(self._rdt, self._ft, self.status, *(v % (1 << 32) for v in values))
        try:
            self.socket.sendto(record, self._client or ("", 0))
        except OSError:
            self.gone += 1
        if self.keep:
            self.sent.append((now, values))
        if self._left is not None:
            self._left -= 1
            if not self._left:
                self._client = None


def _counts(plant: Mechanism) -> list[int]:
    wrench = plant.read().wrench or (0.0,) * 6
    force = [round(value * COUNTS_PER_NEWTON) for value in wrench[:3]]
    return force + [round(value * 1e3 * COUNTS_PER_NEWTON_MILLIMETRE) for value in wrench[3:]]


def _serve_page(host: str, page: str) -> int:
    """Serve the calibration from a thread; return its port."""

    class CalibrationHandler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            is_page = self.path == "/netftapi2.xml"
            body = page.encode() if is_page else b""
            self.send_response(200 if is_page else 404)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    server = ThreadingHTTPServer((host, 0), CalibrationHandler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return int(server.server_address[1])
