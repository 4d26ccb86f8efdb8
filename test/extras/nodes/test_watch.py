"""The live view on a simulated bench: what it shows, what it commands, and zero when nobody holds it."""

import asyncio
import json
import re
import time

import pytest
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from msg_adapters import read_record
from msg_adapters.ros import JointState
from rsea_extras.watch.command import PATIENCE
from rsea_ros.nodes._qos import COMMAND
from test.report.browser import hang_up

AMPLITUDE = 3.0
HOLD = {"do": "hold", "kind": "constant", "amplitude": AMPLITUDE, "frequency": 1.0}


class Page:
    """A page's socket, which keeps what came. held: repeat this wish as a heartbeat."""

    def __init__(self, address, loop):
        self._loop, self.state, self.last, self.errors, self.held = loop, {}, {}, [], None
        host, token = re.match(r"http://([^/]+)/\?token=(.*)", address).groups()
        head = {"Cookie": f"rsea_watch_{host.rpartition(':')[2]}={token}", "Origin": f"http://{host}"}
        self._request = HTTPRequest(f"ws://{host}/socket", headers=head)
        self._reading = None

    async def connect(self):
        self._socket = await websocket_connect(self._request)
        return self

    def send(self, **words):
        return self._socket.write_message(json.dumps(words))

    def close(self):
        hang_up(self._socket)

    async def until(self, condition, seconds=60.0):
        """Read, and beat, until a condition holds."""
        deadline, beat = time.monotonic() + seconds, 0.0
        while not condition():
            assert time.monotonic() < deadline, (self.state, self.errors)
            if self.held and time.monotonic() - beat > 0.1:
                beat = time.monotonic()
                await self.send(**self.held)
            if self._reading is None:
                self._reading = asyncio.ensure_future(self._take())
            await asyncio.wait([self._reading], timeout=0.05)
            if self._reading.done():
                self._reading = self._reading.result()

    async def _take(self):
        message = json.loads(await self._socket.read_message())
        self.state = message.get("state", self.state)
        self.errors += [message["error"]] if "error" in message else []
        self.last |= {k: v[-1] for k, v in message.items() if isinstance(v, list)}


@pytest.fixture(scope="module")
def bench(start, tmp_path_factory):
    """A plant and the live view of it; where its page is, and where its recordings go."""
    out = tmp_path_factory.mktemp("runs")
    start("plant")
    watch = start("watch", command=True, port=0, out=out)
    return watch, out


def address(watch, listener):
    return listener.until(lambda: next((line[5:] for line in watch.output if line.startswith("open ")), None))


def recorder_status(state):
    """What the node record says that it has got."""
    return {key for each in state["health"] if "record" in each["name"] for key, _ in each["values"]}


def test_a_page_sees_commands_and_records(bench, listener):
    """One session: look, record, command, stop, leave."""
    watch, out = bench
    commands = listener.hear(JointState, "/rsea/torque_command", COMMAND)

    async def play():
        page = await Page(address(watch, listener), asyncio.get_running_loop()).connect()
        await page.until(lambda: page.state.get("command", {}).get("why_not") == "" and "ft" in page.last)
        assert page.state["command"]["limit"] == 10.0
        assert {"motor", "ft", "deflection"} <= set(page.last)
        await page.send(do="record")
        await page.until(lambda: any("record" in each["name"] for each in page.state["health"]))
        page.held = HOLD
        await page.until(lambda: page.last["motor"] > 0.9 * AMPLITUDE)
        await page.until(lambda: page.last["command"] == AMPLITUDE)
        await page.until(lambda: {"torque_command", "ft"} <= recorder_status(page.state))
        assert page.state["rates"]["ft"] > 100 and not page.errors
        page.close()  # the phone is gone while it holds the command
        again = await Page(address(watch, listener), asyncio.get_running_loop()).connect()
        left = time.monotonic()
        await again.until(lambda: again.last.get("command") == 0.0)
        assert time.monotonic() - left < PATIENCE + 3.0
        await again.send(do="stop")
        await again.until(lambda: "recordings" in again.state and not again.state["recordings"][0]["running"])
        again.close()

    asyncio.run(play())
    listener.until(lambda: commands and commands[-1].effort[0] == 0.0)
    assert max(m.effort[0] for m in commands) <= AMPLITUDE
    (bag,) = out.iterdir()
    record = read_record(bag)
    assert record["command"].y.max() == AMPLITUDE


def test_only_one_page_commands_at_a_time(bench, listener):
    watch, _ = bench
    other = listener.node.create_publisher(JointState, "/rsea/torque_command", COMMAND)

    async def assert_refused():
        page = await Page(address(watch, listener), asyncio.get_running_loop()).connect()
        await page.until(lambda: "listener commands already" in str(page.state.get("command")))
        await page.send(**HOLD)
        await page.until(lambda: page.errors)
        page.close()
        return page.errors

    assert "/listener commands already" in asyncio.run(assert_refused())[0]
    listener.node.destroy_publisher(other)


def test_the_live_view_ends_when_it_is_stopped(bench):
    watch, _ = bench
    assert watch.stop() == 0, watch.output
    assert not any("Traceback" in line for line in watch.output)
