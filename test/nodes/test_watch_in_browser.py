"""A person looks, records and commands in a real browser, on the plant and on the wire bench."""

from __future__ import annotations

from contextlib import closing

import pytest

from msg_adapters import TopicMap, read_record
from msg_adapters.ros import JointState
from rsea_ros.hardware.peer.remote import RemoteBench
from rsea_ros.nodes._qos import COMMAND
from test.nodes.on_wire import PATIENT, Driven
from test.watch.browser import Browser

LIMIT = 3.0
INK = """(() => { const c = document.getElementById('torque'); const d = c.getContext('2d')
  .getImageData(0, 0, c.width, c.height).data; return d.some((x, k) => k % 4 === 3 && x > 0); })()"""

RECORDED = """[...document.querySelectorAll('#health li')].map((x) => x.textContent)
  .some((x) => ['record', 'torque_command', 'ft'].every((word) => x.includes(word)))"""
"""Whether the node `record` says that it has both."""


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with closing(Browser(tmp_path_factory.mktemp("profile"))) as made:
        yield made


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    made = RemoteBench(tmp_path_factory.mktemp("wire") / "tty")
    yield made
    made.close()


def plant(space, start, listener, bench):
    """The simulated bench; what keeps it going while the page is open."""
    start("plant", remaps={"__ns": f"/{space}"})
    return lambda: None


def wire(space, start, listener, bench):
    """The driver on the bench on a wire, active; a stall of a busy machine is cleared."""
    driven = Driven(bench, listener, space, start, PATIENT)
    driven.drive()
    listener.node.destroy_publisher(driven._commands)  # a page commands nothing beside another node
    return driven._clear_stall


@pytest.mark.parametrize("make", [plant, wire])
def test_a_person_looks_records_and_commands_in_a_browser(make, browser, bench, start, listener, tmp_path):
    space = f"browser_{make.__name__}"
    clear = make(space, start, listener, bench)
    runs = tmp_path / "runs"
    spaces = {"__ns": f"/{space}"}
    watch = start("watch", remaps=spaces, command=True, limit=LIMIT, port=0, rate=100.0, out=runs)
    address = listener.until(lambda: next((x[5:] for x in watch.output if x.startswith("open ")), None))
    commands = listener.hear(JointState, f"/{space}/torque_command", COMMAND)
    browser.errors.clear()
    browser.requests.clear()
    browser.open(address)

    def until(expression):
        listener.until(lambda: clear() or browser.value(f"Boolean({expression})"))

    def click(name):
        browser.value(f"document.getElementById('{name}').click()")

    until("typeof now === 'number' && now > 1.0")
    assert browser.value(INK)
    until(f"document.getElementById('amplitude').max === '{LIMIT:g}'")
    until("!document.getElementById('go').disabled")
    click("record")
    until("document.getElementById('record').className === 'on'")
    until("document.getElementById('recordings').innerText.includes('recording')")
    click("go")
    until("document.getElementById('go').className === 'on'")
    listener.until(lambda: clear() or any(message.effort[0] > 0.0 for message in commands))
    until(RECORDED)
    click("go")
    click("record")
    until("document.querySelectorAll('#recordings button:not(:disabled)').length >= 2")
    assert browser.errors == []
    assert all(request.startswith(address.partition("?")[0]) for request in browser.requests)
    browser.open("about:blank")
    (bag,) = runs.iterdir()
    record = read_record(bag, topics=TopicMap(namespace=space), strict=False)
    assert 0.0 < record["command"].y.max() <= LIMIT
