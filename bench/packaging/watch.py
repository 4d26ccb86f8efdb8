"""Cost of the live view: its processor time as a share of one core, with a page open, at some rates.

A plant, the observer and the node `watch` run as processes of their own; a page is a socket that reads all
frames. The plant's late cycles, without and with
the view for equally long, say whether it delays the loop. Status 1 when the view takes more than 10 % of a
core at 280 Hz, or more cycles are missed with it than without, by more than chance.
"""

from __future__ import annotations

import asyncio
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, websocket_connect

from bench.processes import cpu_time
from rsea_ros.cli._processes import Processes

MOST = 0.10
CHANCE = 3.0
"""Standard deviations by which two counts of missed cycles may differ: both are counts of rare events."""
DOMAIN = 94
ADDRESS = re.compile(r"open http://(\S+)/\?token=(\S+)")


def main(*, rate: tuple[float, ...] = (280.0, 1000.0), seconds: float = 20.0) -> int:
    """Measure at each rate and print a row.

    rate: of the plant, Hz
    seconds: of each measurement
    """
    os.environ["ROS_DOMAIN_ID"] = str(DOMAIN)
    print("    rate  pages    core  frames/s   kB/s  plant's missed cycles/s before, with")
    wrong = False
    for hz in rate:
        for pages, share, delays, row in measure_pages(hz, seconds):
            print(f"{hz:6.0f}Hz {pages:6d} {share:7.1%} {row}{'  delays the loop' * delays}", flush=True)
            wrong |= delays or (hz <= 280.0 and share > MOST)
    return int(wrong)


def measure_pages(rate: float, seconds: float) -> Iterator[tuple[int, float, bool, str]]:
    """Yield pages, share of a core, whether the loop is delayed, the rest of the row: no page, then one."""
    with tempfile.TemporaryDirectory() as folder, Processes(Path(folder), DOMAIN) as nodes:
        nodes.start("plant", {"rate": rate})
        nodes.start("model", {})
        time.sleep(8.0)
        before = missed_rate(seconds)
        nodes.start("watch", {"port": 0})
        address = wait_for(lambda: ADDRESS.search(nodes.log("watch").read_text()))
        time.sleep(3.0)
        for pages in (0, 1):
            share, frames, size, late = asyncio.run(watch_run(nodes.pid("watch"), address, pages, seconds))
            row = f"{frames:9.1f} {size:6.1f}  {before:.2f}, {late:.2f}"
            yield pages, share, is_more(late * seconds, before * seconds), row


def is_more(late: float, before: float) -> bool:
    """Return whether more cycles were missed than before, by more than chance; True for no count (NaN)."""
    return not late - before <= CHANCE * max(1.0, late + before) ** 0.5


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


def wait_for(ask: Callable[[], Any], seconds: float = 30.0) -> Any:
    """Return the first true result of a function within some seconds."""
    deadline = time.monotonic() + seconds
    while not (result := ask()):
        if time.monotonic() > deadline:
            raise TimeoutError("the node did not start")
        time.sleep(0.1)
    return result
