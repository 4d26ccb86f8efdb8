"""The stamp of a command of the controller: the next instant in the grid of the measurements."""

from types import SimpleNamespace

import pytest

from rsea_ros.control.controller import Measurement, Share
from rsea_ros.nodes import controller
from rsea_ros.nodes._commands import CommandQueue

PERIOD = 1_000_000
START = 1_700_000_000 * 10**9


@pytest.fixture
def program(listener, monkeypatch):
    """A controller node that always commands its sample's number; `sent` has (stamp, torque)."""
    steps = iter(range(1, 1000))
    stub = SimpleNamespace(
        start=lambda *now: None, step=lambda *now, **more: float(next(steps)), share=Share()
    )
    monkeypatch.setattr(controller, "design_of", lambda values: None)
    monkeypatch.setattr(controller, "summary", lambda design: [])
    monkeypatch.setattr(controller, "controller_of", lambda values, design, link: stub)
    monkeypatch.setattr(controller, "keep_time", lambda *worker: None)
    values = {parameter.name: parameter.default for parameter in controller.TABLE} | {"rate": 1000.0}
    made = controller.ControllerNode(listener.node, values | {"ft_limit": 1e3, "error_limit": 0.0})
    made.sent = []
    made._polarity = SimpleNamespace(
        proven=True, contradiction="", start=lambda: None, watch=lambda *now: "",
        sent=lambda torque: None, doubted=False,
    )  # fmt: skip
    made._writer = SimpleNamespace(write=lambda stamp, torques: (stamp, *torques))
    made._commands = SimpleNamespace(publish=made.sent.append)
    return made


def test_a_command_for_a_late_measurement_acts_in_the_next_cycle_all_the_same(program):
    """Measurements are 0.3 ms behind their cycle, one in ten 0.7 ms: its command acted a cycle later."""
    queue, acted = CommandQueue(strict=True), []
    for k in range(60):
        cycle = START + k * PERIOD
        queue.take(cycle + PERIOD // 2)
        acted.append(queue.torque)
        stamp = cycle + (700_000 if k % 10 == 9 else 300_000)
        program._measure(stamp, Measurement(0.0, 0.0, 0.0), 1)
        at, torque = program.sent[-1]
        queue.add(at, torque, stamp)
    assert acted == [float(k) for k in range(60)]
