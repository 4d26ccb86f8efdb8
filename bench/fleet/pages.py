"""How long the report of a fleet takes to write and its pages to open: required and measured times.

python -m bench fleet pages [--rows 100000] [--chromium chromium]

Writes the report of a simulated fleet of 10 000 recordings and of a history of --rows rows; opens the page of
the fleet and of two joints in a headless Chromium; counts their requests to other hosts and their messages on
the console.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from tornado.websocket import WebSocketClientConnection, websocket_connect

from bench import parser_of
from bench.fleet.simulated import fleet
from rsea_ros.report.fleet.page import write_fleet_report

DRAWN = """document.readyState === 'complete' && location.protocol === 'file:' &&
  [...document.querySelectorAll('.figure')].every((f) => f.dataset.drawn) &&
  document.querySelectorAll('.figure, .heat svg, .spans').length"""
PATIENCE = 60.0
"""s after which a page counts as not drawn."""


def enlarge(history: Mapping[str, np.ndarray], rows: int) -> dict[str, np.ndarray]:
    """Return a history of so many rows: its parameters again under other names."""
    copies = -(-rows // len(history["joint"]))
    out = {n: np.concatenate([c] * copies)[:rows] for n, c in history.items()}
    number = np.repeat(np.arange(copies), len(history["joint"]))[:rows]
    prefixed = np.char.add(np.char.add("copy", number.astype(str)), ".")
    out["parameter"] = np.where(number > 0, np.char.add(prefixed, out["parameter"]), out["parameter"])
    return out


class Browser:
    """A headless Chromium, controlled over its debugging port."""

    def __init__(self, program: str, folder: str) -> None:
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"]
        self._process = subprocess.Popen(
            [program, *options, f"--user-data-dir={folder}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        port = Path(folder) / "DevToolsActivePort"
        while not port.exists() or not port.read_text().count("\n"):
            time.sleep(0.05)
        self._port = port.read_text().splitlines()[0]

    async def opened(self, page: Path) -> dict[str, Any]:
        """Return seconds until all figures are drawn, requests beyond the page itself, console messages."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self._port}/json") as answer:
            target = next(t for t in json.load(answer) if t["type"] == "page")
        socket = await websocket_connect(target["webSocketDebuggerUrl"], max_message_size=1 << 28)
        talk = Talk(socket)
        for domain in ("Page", "Runtime", "Network", "Log"):
            await talk.ask(f"{domain}.enable")
        begun, spent = time.perf_counter(), self._cpu()
        await talk.ask("Page.navigate", url=page.as_uri())
        figures = 0
        while not figures and time.perf_counter() - begun < PATIENCE:
            await asyncio.sleep(0.02)
            answer = await talk.ask("Runtime.evaluate", expression=DRAWN)
            figures = answer["result"].get("value") or 0
        seconds = time.perf_counter() - begun
        socket.close()
        return {
            "seconds": seconds,
            "cpu": self._cpu() - spent,
            "figures": figures,
            "requests": talk.requests,
            "console": talk.console,
        }

    def _cpu(self) -> float:
        """Return seconds of processor time of the browser's processes so far, all cores together."""
        parents, spent = {}, {}
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = stat.read_text().rpartition(")")[2].split()
            except OSError:
                continue
            number = int(stat.parent.name)
            parents[number] = int(fields[1])
            spent[number] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        mine = {self._process.pid}
        while more := {n for n, p in parents.items() if p in mine and n not in mine}:
            mine |= more
        return sum(spent[n] for n in mine if n in spent)

    def close(self) -> None:
        """End the browser."""
        self._process.terminate()
        self._process.wait()


class Talk:
    """Questions and answers of the debugging protocol; events of the page in between are counted."""

    def __init__(self, socket: WebSocketClientConnection) -> None:
        self._socket, self._number = socket, 0
        self.requests: list[str] = []
        self.console: list[str] = []

    async def ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Return the answer to a question."""
        self._number += 1
        await self._socket.write_message(
            json.dumps({"id": self._number, "method": method, "params": parameters})
        )
        while True:
            message = json.loads(await self._socket.read_message() or "{}")
            if message.get("id") == self._number:
                return dict(message.get("result", {}))
            self._heard(message)

    def _heard(self, message: Mapping[str, Any]) -> None:
        kind, about = message.get("method", ""), message.get("params", {})
        if kind == "Network.requestWillBeSent" and not about["request"]["url"].startswith(("file:", "data:")):
            self.requests.append(about["request"]["url"])
        if kind in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"):
            self.console.append(json.dumps(about)[:200])


def main(argv: Sequence[str]) -> int:
    """Print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--rows", type=int, default=100_000, help="rows of the history (default %(default)s)")
    parser.add_argument("--chromium", default="chromium", help="the browser (default %(default)s)")
    args = parser.parse_args(argv)
    made = fleet(1)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        history = enlarge(made.history, args.rows)
        begun, before = time.perf_counter(), time.process_time()
        write_fleet_report(history, made.recordings, out / "large")
        seconds, spent = time.perf_counter() - begun, time.process_time() - before
        print(f"{'asked':<52}measured")
        load = f"{os.getloadavg()[0]:.0f} processes on {os.cpu_count()} cores"
        print(
            f"{f'{args.rows} rows reported in <= 10 s':<52}{seconds:.1f} s "
            f"({spent:.1f} s of processor; {load})"
        )
        write_fleet_report(made.history, made.recordings, out / "fleet")
        if shutil.which(args.chromium):
            _open(args.chromium, out)
        else:
            print(f"pages not opened: no {args.chromium}")
    return 0


def _open(program: str, out: Path) -> None:
    bags = 10_000
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(program, profile)
        try:
            for name in ("index.html", "joint-J01.html", "joint-J20.html"):
                said = asyncio.run(browser.opened(out / "fleet" / name))
                asked = f"{name} of {bags} bags open in <= 3 s"
                outside = f"{len(said['requests'])} requests, {len(said['console'])} console messages"
                took = f"{said['seconds']:.2f} s ({said['cpu']:.2f} s of processor)"
                print(f"{asked:<52}{took}, {said['figures']} figures, {outside}")
        finally:
            browser.close()
