"""Cost of the live view: its processor time as a share of one core, with a page open, at some rates.

A plant, the observer and the node `watch` run as processes of their own; a page is a socket that reads all
frames. The plant's late cycles, without and with
the view for equally long, say whether it delays the loop: whether more are missed, by more than chance.
Status 1 when it does, or takes more than MOST.
"""

from __future__ import annotations

import asyncio
import os
import re
import sys
import tempfile
import time
from collections.abc import Generator
from pathlib import Path

from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, websocket_connect

from bench.processes import cpu_time
from bench.results import Row
from rsea_ros.cli._processes import Processes

MOST = 0.10
"""Share of a core that the view may take at 280 Hz."""
CHANCE = 3.0
"""Standard deviations by which two counts of missed cycles may differ: both are counts of rare events."""
DOMAIN = 94
ADDRESS = re.compile(r"open http://(\S+)/\?token=(\S+)")


def main(*, rate: tuple[float, ...] = (280.0, 1000.0), seconds: float = 20.0) -> Generator[Row, None, int]:
    """Measure at each rate, without a page, then with one.

    rate: of the plant, Hz
    seconds: of each measurement
    """
    os.environ["ROS_DOMAIN_ID"], wrong = str(DOMAIN), False
    for hz in rate:
        with tempfile.TemporaryDirectory() as folder, Processes(Path(folder), DOMAIN) as nodes:
            nodes.start("plant", {"rate": hz})
            nodes.start("model", {})
            time.sleep(8.0)
            before = missed_rate(seconds)
            nodes.start("watch", {"port": 0})
            deadline = time.monotonic() + 30.0
            while not (address := ADDRESS.search(nodes.log("watch").read_text())):
                if time.monotonic() > deadline:
                    raise TimeoutError("the node did not start")
                time.sleep(0.1)
            time.sleep(3.0)
            for pages in (0, 1):
                run = watch_run(nodes.pid("watch"), address, pages, seconds)
                share, frames, size, late = asyncio.run(run)
                told = {"core, %": f"{100.0 * share:.1f}", "frames/s": f"{frames:.1f}", "kB/s": f"{size:.1f}"}
                told |= {"plant's missed cycles/s before": f"{before:.2f}", "with": f"{late:.2f}"}
                by_chance = CHANCE * max(1.0, (late + before) * seconds) ** 0.5
                delays = not (late - before) * seconds <= by_chance
                wrong |= delays or (hz <= 280.0 and share > MOST)
                told["delays the loop"] = "YES" if delays else "no"
                yield Row(f"{hz:.0f} Hz, {pages} pages", f"at 280 Hz <= {MOST:.0%} of a core, no delay", told)
    return int(wrong)


async def watch_run(
    pid: int, address: re.Match[str], pages: int, seconds: float
) -> tuple[float, float, float, float]:
    """Return share of a core, frames/s, kB/s and the plant's missed cycles/s while some pages are open."""
    host, token = address.groups()
    port = host.rpartition(":")[2]
    head = {"Cookie": f"rsea_watch_{port}={token}", "Origin": f"http://{host}"}
    request = HTTPRequest(f"ws://{host}/socket", headers=head)
    sockets = [await websocket_connect(request) for _ in range(pages)]
    counts = [0, 0]

    async def read(socket: WebSocketClientConnection) -> None:
        while (text := await socket.read_message()) is not None:
            counts[0] += '"t0"' in text
            counts[1] += len(text)

    readers = [asyncio.ensure_future(read(s)) for s in sockets]
    used, begin = cpu_time(pid), time.monotonic()
    late = await asyncio.get_running_loop().run_in_executor(None, missed_rate, seconds)
    span = time.monotonic() - begin
    for each in readers:
        each.cancel()
    return (cpu_time(pid) - used) / span, counts[0] / span, 1e-3 * counts[1] / span, late


def missed_rate(seconds: float) -> float:
    """Return the plant's missed cycles a second, as its diagnostics say; NaN without any."""
    from rsea_ros.nodes._visitor import Listener, visit

    values = []
    with visit("bench_watch") as node:
        deadline = time.monotonic() + seconds
        for text in Listener(node).messages("/diagnostics", sys.maxsize, 5.0):
            if "/rsea/plant" in text and (count := re.search(r"missed_cycles\n\s+value: '?(\d+)", text)):
                values.append(int(count[1]))
            if time.monotonic() > deadline:
                break
    return (values[-1] - values[0]) / seconds if values else float("nan")
