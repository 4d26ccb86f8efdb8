"""The server refuses clients without a token or of another page; one that leaves releases the command."""

import asyncio
import http.client
import json
import time
import urllib.error
import urllib.request

import pytest
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from rsea_extras.watch.command import PATIENCE
from rsea_extras.watch.desk import MOST_PAGES, MOST_WAITING, Desk, Runs
from rsea_extras.watch.handlers import Access, same_origin
from rsea_extras.watch.server import Server
from rsea_ros.errors import RseaError
from test.report.browser import hang_up


def status(server, path, **headers):
    request = urllib.request.Request(f"http://localhost:{server.port}{path}", headers=headers)
    try:
        with urllib.request.urlopen(request) as answer:
            return answer.status, answer.headers
    except urllib.error.HTTPError as error:
        return error.code, error.headers


def cookie(server):
    return f"{server.access.cookie}={server.access.token}"


@pytest.mark.parametrize("path", ["/", "/?token=wrong", "/watch.js", "/plot.js", "/socket", "/report/x/y"])
def test_without_the_token_nothing_is_served(server, path):
    assert status(server, path)[0] == 403
    assert status(server, path, Cookie=f"{server.access.cookie}=wrong")[0] == 403


def test_the_printed_address_sets_the_cookie_and_forbids_foreign_content(server):
    (address,) = server.addresses
    code, headers = status(server, address.partition(str(server.port))[2])
    assert code == 200
    assert headers["Set-Cookie"] == f"{cookie(server)}; HttpOnly; Path=/; SameSite=Strict"
    assert headers["Content-Security-Policy"].startswith("default-src 'self';")
    assert status(server, "/watch.js", Cookie=cookie(server))[0] == 200


@pytest.mark.parametrize(
    ("origin", "host", "same"),
    [
        ("http://localhost:8270", "localhost:8270", True),
        ("http://LOCALHOST:8270", "localhost:8270", True),
        ("http://localhost:8271", "localhost:8270", False),
        ("http://evil.example", "localhost:8270", False),
        ("null", "localhost:8270", False),
        (None, "localhost:8270", False),
    ],
)
def test_another_origin_is_refused(origin, host, same):
    assert same_origin(origin, host) is same


def test_a_port_in_use_is_one_line(server, tmp_path):
    with pytest.raises(RseaError, match=f"page on localhost, port {server.port}: "):
        Server(None, Runs(tmp_path), None, port=server.port)


async def connect(server):
    host = f"localhost:{server.port}"
    head = {"Cookie": cookie(server), "Origin": f"http://{host}"}
    return await websocket_connect(HTTPRequest(f"ws://{host}/socket", headers=head))


async def answer(page, key):
    """Return the next message that has a key."""
    while True:
        message = json.loads(await asyncio.wait_for(page.read_message(), 10.0))
        if key in message:
            return message


UPGRADE = {
    "Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}  # fmt: skip


@pytest.mark.parametrize("origin", ["http://evil.example", "null"])
def test_a_socket_of_another_page_is_refused(server, origin):
    client = http.client.HTTPConnection("localhost", server.port)
    client.request("GET", "/socket", headers={"Cookie": cookie(server), "Origin": origin, **UPGRADE})
    assert client.getresponse().status == 403
    client.close()


HOLD = {"do": "hold", "kind": "constant", "amplitude": 5.0, "frequency": 1.0}


def test_a_page_whose_socket_is_lost_lets_go_at_once(server, commander):
    async def talk():
        page = await connect(server)
        await page.write_message(json.dumps(HOLD))
        await answer(page, "ft")
        assert commander.holder is not None
        page.stream.close()  # as a phone that leaves the network
        begun, late = time.monotonic(), 0.0
        while commander.holder is not None and time.monotonic() - begun < 60.0:
            before = time.monotonic()
            await asyncio.sleep(0.005)
            late += time.monotonic() - before - 0.005  # by which this machine stood still
        hang_up(page)
        return time.monotonic() - begun - late

    assert asyncio.run(talk()) < PATIENCE


class Page:
    """A page as the desk sees it. waiting: frames that it has not taken. got: what was sent."""

    def __init__(self, waiting=0):
        self.waiting, self.got = waiting, []

    def send(self, text):
        self.got.append(text)


@pytest.mark.parametrize(
    ("message", "told"),
    [
        ("no json", "Expecting value"),
        ("[]", "expected do: one of hold, release"),
        ('{"do": "reboot"}', "expected do: one of hold, release"),
        (json.dumps({**HOLD, "amplitude": 10.5}), "expected at most 10 N·m"),
        (json.dumps({**HOLD, "amplitude": "x"}), "amplitude = 'x', expected a number"),
        (json.dumps({**HOLD, "amplitude": None}), "amplitude = None, expected a number"),
        ('{"do": "hold", "kind": "constant"}', "amplitude = None"),
        ('{"do": "evaluate", "recording": "../x", "verb": "identify"}', "expected one that is complete"),
    ],
)
def test_a_page_is_informed_of_what_it_may_not_do(tmp_path, commander, message, told):
    page = Page()
    Desk(commander, Runs(tmp_path)).act(page, message)
    assert told in json.loads(page.got[0])["error"]
    assert not commander.active


def test_a_page_may_only_look_unless_the_server_was_started_to_command(tmp_path):
    page = Page()
    Desk(None, Runs(tmp_path)).act(page, json.dumps(HOLD))
    assert "may only look; rsea watch --command" in page.got[0]


def test_a_slow_page_misses_frames_and_nobody_waits(tmp_path):
    desk, page = Desk(None, Runs(tmp_path)), Page(MOST_WAITING)
    assert desk.enter(page)
    desk.send("frame")
    assert page.got == []
    assert [desk.enter(Page()) for _ in range(MOST_PAGES)] == [True] * (MOST_PAGES - 1) + [False]


def test_a_token_is_new_at_every_start_and_long():
    assert Access("a").token != Access("a").token
    assert len(Access("a").token) >= 22


@pytest.mark.parametrize("path", ["/report/../x", "/report/none/identify", "/page/index.html", "/..%2fa.py"])
def test_only_pages_that_were_made_are_served(server, path):
    assert status(server, path, Cookie=cookie(server))[0] == 404
