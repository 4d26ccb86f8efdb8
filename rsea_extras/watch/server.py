"""The server of the page, in a thread of its own: HTTP and WebSocket by tornado, thinned frames at 30 Hz."""

import asyncio
import json
import socket
import threading
import time
from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Any, Protocol

from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.web import Application

from rsea_extras.watch.command import Commander
from rsea_extras.watch.desk import Desk, Runs
from rsea_extras.watch.handlers import Access, addresses, routes
from rsea_ros import RseaError

Samples = Sequence[tuple[float, float]]
"""Time, s, and value of each sample."""


def extremes(samples: Samples) -> Samples:
    """Return the least and the largest of some samples in order, one where they are the same, none of none.

    Not-a-number is left out.
    """
    known = [s for s in samples if s[1] == s[1]]
    if len(known) < 2:
        return known
    low, high = min(known, key=itemgetter(1)), max(known, key=itemgetter(1))
    if low is high:
        return [known[-1]]
    return [low, high] if low[0] <= high[0] else [high, low]


CHANNELS = ("command", "motor", "ft", "proximal", "distal", "disturbance", "deflection")
"""Torques N m, deflection rad."""


class FrameSource(Protocol):
    """The source of the page's numbers; called by one thread, and never blocks.

    flag: whether the actuator is a pure torque source, None: unknown.
    """

    flag: bool | None

    def take(self) -> Mapping[str, Samples]:
        """Return the samples of CHANNELS that have come since the last call: s since the start, value."""

    def state(self) -> Mapping[str, Any]:
        """Return the slow state: flag, health, rates, limits."""


def frame(batch: Mapping[str, Samples], flag: bool | None) -> str | None:
    """Return a frame as JSON, None when nothing has come.

    {"t0": s, "pure": true, "ft": [ms, value, ms, value], …}: the extremes of each channel, in order.
    """
    kept = {name: extremes(samples) for name, samples in batch.items()}
    firsts = [samples[0][0] for samples in kept.values() if samples]
    if not firsts:
        return None
    begin = min(firsts)
    rows = {
        name: [x for t, v in samples for x in (round(1e3 * (t - begin), 1), float(f"{v:.6g}"))]
        for name, samples in kept.items() if samples
    }  # fmt: skip
    return json.dumps({"t0": round(begin, 4), "pure": flag, **rows}, separators=(",", ":"))


FRAME, STATE = 1.0 / 30.0, 0.5
"""s between frames, and between looks at everything else."""
_LARGEST = 16_384
"""Bytes of a request; those of the page have a thousand."""
_SETTINGS: Mapping[str, Any] = {
    "log_function": lambda handler: None,
    "websocket_ping_interval": 10.0,
    "websocket_max_message_size": 4096,
}


class Server:
    """Serves the page from `start` to `stop`. access: the token. addresses: to open in a browser.

    Raises RseaError when nothing can listen there.
    """

    def __init__(
        self, source: FrameSource, runs: Runs, commander: Commander | None, host: str = "localhost",
        port: int = 0,
    ) -> None:  # fmt: skip
        self._source, self._runs = source, runs
        self.desk = Desk(commander, runs)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            made = socket.create_server((host, port), family=family)
        except OSError as error:
            raise RseaError(f"page on {host}, port {port}: {error.strerror or error}") from None
        made.setblocking(False)
        self._socket = made
        self.port: int = self._socket.getsockname()[1]
        self.access = Access(f"rsea_watch_{self.port}")  # a cookie belongs to a host, not to a port
        self.addresses: Sequence[str] = addresses(host, self.port, self.access.token)
        self.error: Exception | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready = threading.Event()
        self._state_due = 0.0
        self.thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        self.thread.start()
        self._ready.wait()

    def stop(self) -> None:
        """End: sockets closed, so that nobody holds the command."""
        if self._loop is not None and self.thread.is_alive():
            self._loop.call_soon_threadsafe(self._stopping.set)
            self.thread.join()
        self._socket.close()
        self._runs.close()

    def is_running(self) -> bool:
        """Return whether it serves. Raises the error that ended it."""
        if self.error is not None:
            raise self.error
        return self.thread.is_alive()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:  # handed to the main thread by `running`
            self.error = error
        finally:
            self.desk.leave_all()
            self._ready.set()

    async def _serve(self) -> None:
        self._loop, self._stopping = asyncio.get_running_loop(), asyncio.Event()
        web = Application(routes(self.access, self.desk, self._runs), **_SETTINGS)
        http = HTTPServer(web, max_body_size=_LARGEST, max_header_size=_LARGEST)
        http.add_socket(self._socket)
        ticking = PeriodicCallback(self._tick, 1e3 * FRAME)
        ticking.start()
        self._ready.set()
        await self._stopping.wait()
        ticking.stop()
        http.stop()
        await http.close_all_connections()

    def _tick(self) -> None:
        if not self.desk.count:
            return
        state, now = None, time.monotonic()
        if now >= self._state_due:
            self._state_due, state = now + STATE, self.desk.state(self._source.state())
        self.desk.send(frame(self._source.take(), self._source.flag), state)
