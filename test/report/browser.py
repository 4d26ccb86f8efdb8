"""A headless Chromium, driven by its DevTools protocol: its page, its log, its requests."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
import subprocess
import time
import urllib.request

import pytest
from tornado.websocket import websocket_connect

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--remote-debugging-port=0",
)  # fmt: skip
WAIT = 30.0


def chromium():
    """Return the path of the browser; without one the test is skipped."""
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        pytest.skip("chromium not installed: apt-get install chromium")
    return path


class Browser:
    """One page in a browser of its own. errors: of its console. requests: addresses that it asked for."""

    def __init__(self, folder):
        self.errors, self.requests = [], []
        words = [chromium(), *FLAGS, f"--user-data-dir={folder}", "about:blank"]
        self._loop = asyncio.new_event_loop()
        self._number = 0
        self._process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        port = _wait_for(lambda: (folder / "DevToolsActivePort").read_text().partition("\n")[0])
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = json.load(answer)
        (page,) = [p for p in pages if p["type"] == "page"]
        self._socket = self._done(lambda: websocket_connect(page["webSocketDebuggerUrl"]))
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.call(f"{domain}.enable")

    def call(self, method, **parameters):
        """Call a method of the protocol and return its result."""
        self._number += 1
        words = json.dumps({"id": self._number, "method": method, "params": parameters})
        self._done(lambda: self._socket.write_message(words))
        while True:
            answer = json.loads(self._done(self._socket.read_message))
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer)

    def _done(self, begin):
        async def done():
            return await begin()

        return self._loop.run_until_complete(done())

    def _note(self, event):
        given = event.get("params", {})
        if event["method"] == "Runtime.exceptionThrown":
            self.errors.append(str(given["exceptionDetails"].get("exception", given)))
        elif event["method"] == "Runtime.consoleAPICalled":
            self.errors.append(str(given["args"]))
        elif event["method"] == "Log.entryAdded":
            self.errors.append(f"{given['entry']['text']} {given['entry'].get('url', '')}")
        elif event["method"] == "Network.requestWillBeSent":
            self.requests.append(given["request"]["url"])

    def open(self, address, width=1400, height=900):
        """Open an address in a window of a size, px."""
        self.size(width, height)
        self.call("Page.navigate", url=address)

    def size(self, width, height):
        """Show the page as a screen of that size does."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                  mobile=width < 600)  # fmt: skip

    def value(self, expression):
        """Return what an expression is in the page."""
        return self.call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def until(self, expression, seconds=WAIT):
        """Wait until an expression is true in the page."""
        return _wait_for(lambda: self.value(f"Boolean({expression})"), seconds, expression)

    def picture(self, path, dark=False):
        """Write the whole page as PNG."""
        theme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=theme)
        time.sleep(0.4)
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=True)
        path.write_bytes(base64.b64decode(shot["data"]))

    def close(self):
        """End it."""
        async def leave():
            hang_up(self._socket)

        self._done(leave)
        self._loop.close()
        self._process.terminate()
        self._process.wait(10)


def hang_up(socket):
    """Close a client's web socket at once: a loop that ends before the other end's answer leaves it open."""
    stream = socket.protocol.stream
    socket.close()
    stream.close()


def _wait_for(ask, seconds=WAIT, what="an answer"):
    deadline = time.monotonic() + seconds
    while True:
        try:
            if result := ask():
                return result
        except OSError:
            pass
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.05)
