"""Steps of the controller's node without ROS: faults, releases, desired torques, zeros, and its report."""

import math
import threading
from itertools import count
from types import SimpleNamespace

import pytest

from rsea_ros.control.controller import Measurement
from rsea_ros.control.grid import Grid
from rsea_ros.control.link import LinkShare
from rsea_ros.nodes import controller as module
from rsea_ros.nodes._commands import CommandQueue, Obeyed
from rsea_ros.nodes._control import LinkFeedforward
from rsea_ros.nodes._health import ERROR, OK, WARN
from rsea_ros.nodes.controller import ControllerNode

MS = 1_000_000
PERIOD = 10 * MS


@pytest.fixture
def made(monkeypatch):
    """Return a node whose parts are stubs, what it published and a clock (ns)."""
    now, out, calls = [5_000 * MS], [], []
    monkeypatch.setattr(module.time, "monotonic_ns", lambda: now[0])
    monkeypatch.setattr(module, "await_arrival", lambda publisher: calls.append("arrived"))
    node = ControllerNode.__new__(ControllerNode)
    node._node = SimpleNamespace(get_logger=lambda: SimpleNamespace(error=calls.append, info=calls.append))
    node._values = {"stale": 0.05, "release": 0.1, "preview": False, "rate": 100.0, "torque_limit": 68.0}
    node._period, node._lock = float(PERIOD), threading.Lock()
    margins = {"locked": (30.0, 50.0, 9.0, 1.5), "free": (20.0, 45.0, 8.0, 1.25)}
    node._design = SimpleNamespace(margins={
        n: SimpleNamespace(crossover=c, phase=p, gain=g, delay=d) for n, (c, p, g, d) in margins.items()
    })  # fmt: skip
    node._link = LinkFeedforward(LinkShare(), None, "link is false")
    senders = {what: Obeyed() for what in ("joint_states", "wrenches", "desired torques")}
    node._inputs = SimpleNamespace(unusable=2, senders=senders, hear_desired=lambda anchor: None)
    node._desired = SimpleNamespace(
        torque=1.5, stamp=1000, expired=3, refused=4, age=lambda now: None,
        take=lambda until: calls.append(until) or [],
        shift=lambda by: calls.append(("shift", by)), clear=lambda at: calls.append(("clear", at)),
    )  # fmt: skip
    node._anchor = SimpleNamespace(now=lambda: now[0], values=lambda: {"clock": "fine"}, follow=lambda: None)
    node._grid = SimpleNamespace(
        next=77, at=1000, offset=0.25, jumps=lambda stamp: False, place=lambda stamp: 1,
        forget=lambda: calls.append("forget"),
    )  # fmt: skip
    lateness = SimpleNamespace(trust=0.75, tolerance=SimpleNamespace(late=0.5), take=lambda late, n: 0.9)
    node._limits = SimpleNamespace(
        lateness=lateness, clear=lambda: calls.append("limits"), idle=lambda sent, made: False,
        falsified=lambda *a: "", fault=lambda ft, desired: "", contradiction="",
    )  # fmt: skip
    node._polarity = SimpleNamespace(
        proven=True, contradiction="", start=lambda: calls.append("polarity"), watch=lambda r, m: False,
        sent=lambda torque: calls.append(("sent", torque)), probe=lambda *a, **k: None, doubted=False,
    )  # fmt: skip
    share = SimpleNamespace(feedback=0.5, compensation=0.25, limited=True)
    node._controller = node._newest = SimpleNamespace(
        share=share, step=lambda *a, **k: calls.append((a[1:], k)) or 2.5,
        start=lambda r, desired: calls.append(("start", desired)),
    )  # fmt: skip
    node._commands = SimpleNamespace(publish=out.append)
    node._writer = SimpleNamespace(write=lambda stamp, values: (stamp, *values))
    node._waiter = SimpleNamespace(stop=lambda: calls.append("stop"), is_running=lambda: True)
    node._health = SimpleNamespace(publish=lambda: calls.append("health"))
    node._last, node._heard, node._watched, node._lag, node._torque = 900, now[0], 0, 0.0, 4.0
    node._fault, node._told_fault, node._release = "", "", (0, 0.0)
    node._wished, node._held, node._squares = True, False, [4.0, 16.0]
    node._told_losses, node._told_ignored = 0, {}
    node._steps = node._missed = node._limited = node._late = node._late_reported = node._restarts = 0
    return node, now, out, calls


READING = Measurement(1.0, 0.0, 0.0, 0.5)


def test_measurements_that_cease_latch_a_fault_and_release_the_torque(made):
    node, now, out, _ = made
    node._watch()
    now[0] += 49 * MS
    node._watch()
    assert not node._fault and not out
    now[0] += 12 * MS
    node._watch()
    assert node._fault == "no usable measurement for 61 ms, expected one within 50 ms"
    assert out == [(now[0], 4.0)]
    now[0] += 25 * MS
    node._watch()
    now[0] += 100 * MS
    node._watch()
    assert [torque for _, torque in out] == pytest.approx([4.0, 3.0, 0.0])
    node._last, node._fault = 0, ""
    node._watch()
    assert not node._fault
    node._values["release"] = 0.0
    node._torque = 4.0
    node._latch("broken")
    now[0] += round(2.5 * MS)
    node._watch()
    assert node._torque == pytest.approx(2.0)  # over the 5 ms of a look


def test_a_fault_is_told_once_and_cleared_at_zero_torque(made):
    node, now, _, calls = made
    assert not node.is_finished() and not calls
    node._fault = "broken"
    assert not node.is_finished() and not node.is_finished()
    assert calls == ["broken; torque zero until clear_fault", "health"]
    answer = node._clear(None, SimpleNamespace())
    assert answer.success and answer.message == "clear_fault: done"
    assert (node._fault, node._last, node._torque, node._wished) == ("", 0, 0.0, False)
    assert calls[2:] == ["forget", "limits", ("clear", now[0])]
    node._waiter.is_running = lambda: False
    assert node.is_finished()


def test_the_end_is_three_zeros_after_the_last_command(made):
    node, now, out, calls = made
    node._last = now[0] + 3 * MS
    node._steps = 9
    node.close()
    after = node._last + PERIOD
    assert out == [(after + k * PERIOD, 0.0) for k in (1, 2, 3)]
    assert calls == ["stop", "arrived", "torque zero after 9 commands"]
    node._last = 0
    node.close()
    assert len(out) == 3
    node._last = 1
    node.close()
    assert out[3:] == [(now[0] + k * PERIOD, 0.0) for k in (1, 2, 3)]


@pytest.mark.parametrize(
    ("stamp", "is_new", "preview", "off"),
    [(0.0, True, False, 0.0), (0.4, True, False, 0.4), (-0.4, True, False, -0.4),
     (-0.9, True, False, -0.892), (-2.4, False, False, -2.4), (2.0, True, True, 0.0)],
)  # fmt: skip
def test_a_desired_torque_is_taken_for_its_own_instant(made, stamp, is_new, preview, off):
    """In samples. Of 0.4 that one came too late for its sample, a fiftieth is taken for the sender's way."""
    node, _, _, calls = made
    node._values["preview"], node._wished = preview, False
    node._desired.stamp = 1000 + round(stamp * PERIOD)
    node._desired.take = lambda until: calls.append(until) or ([(1, 1.0)] if is_new else [])
    assert node._take_desired() == pytest.approx(off, abs=1e-6)
    assert calls == [1000 + 5 * MS + (20 * MS if preview else 0)] and node._wished == is_new


def test_a_sender_that_is_always_late_means_a_later_sample(made):
    node, _, _, _ = made
    node._desired.stamp, node._desired.take = 1000 - 15 * MS, lambda until: [(1, 1.0)]
    for _ in range(300):
        off = node._take_desired()
    assert off == pytest.approx(-0.5, abs=0.01)


def test_a_command_is_counted_published_and_remembered(made):
    node, _, out, calls = made
    node._command(5_000 * MS - PERIOD, READING, 2, 1)
    assert out == [(77, 2.5)] and (node._last, node._steps, node._missed) == (5_000 * MS - PERIOD, 1, 2)
    assert (node._limited, node._late) == (1, 0) and node._squares[-1] == 0.25
    assert calls[1:] == [((1.5, 2), {"trust": 0.9, "offset": 0.25, "desired_offset": 0.0}), ("sent", 2.5)]
    node._command(5_000 * MS - 16 * MS, READING, 0, 1)
    assert node._late == 1
    node._command(5_000 * MS - 14 * MS, READING, 0, 1)
    node._command(5_000 * MS - 90 * MS, READING, 0, 0)
    assert node._late == 1
    for cause in ("falsified", "fault"):
        setattr(node._limits, cause, lambda *a: "too much")
        node._torque = 4.0
        node._command(1, READING, 0, 1)
        assert node._fault == "too much" and node._release == (5_000 * MS, 4.0) and len(out) == 4
        setattr(node._limits, cause, lambda *a: "")
    node._polarity.contradiction = "ft is reversed"
    node._command(1, READING, 0, 1)
    assert node._fault == "ft is reversed" and node._steps == 4


def test_signs_are_probed_first_and_a_torque_that_comes_back_starts_anew(made):
    node, _, _, calls = made
    node._polarity.watch = lambda r, m: True
    assert node._next_torque(READING, 3, 1.0, 0.0, acts=True) == 0.0
    node._polarity.watch = lambda r, m: False
    node._desired.age = lambda now: 0.1
    assert node._next_torque(READING, 3, 1.0, 0.0, acts=True) == 2.5
    assert calls[0] == ("start", 1.5) and calls[1][0] == (1.5, 0)
    del calls[:]
    node._next_torque(READING, 3, 1.0, 0.0, acts=True)
    assert calls[0][0] == (1.5, 3)
    felt = []
    node._polarity.doubted, node._controller.step = True, lambda r, *a, **k: felt.append(r.ft) or 2.5
    assert node._next_torque(READING, 0, 1.0, 0.0, acts=True) == 2.5 and math.isnan(felt[0])
    node._polarity.doubted = False
    probed = []
    node._polarity.proven = False
    node._polarity.probe = lambda *a, **k: probed.append((a[1:], k)) or 0.25
    assert node._next_torque(READING, 3, 1.0, 0.0, acts=False) == 0.25
    node._wished = False
    node._next_torque(READING, 3, 1.0, 0.0, acts=True)
    assert probed == [((1.5, 3), {"acts": False}), ((None, 3), {"acts": True})]


def test_a_clock_that_was_set_and_a_pause_start_anew(made):
    node, _, _, calls = made
    asked = []
    node._command = lambda *a: asked.append(a)
    node._measure(950, READING, 1)
    assert asked == [(950, READING, 0, 1)] and node._heard == 5_000 * MS
    node._grid.place = lambda stamp: 6
    node._measure(950, READING, 1)
    assert asked[-1][2] == 5
    node._grid.place = lambda stamp: 7  # more than 50 ms are missing
    node._measure(950, READING, 1)
    assert asked[-1][2] == 0 and node._last == 0
    node._grid.place = lambda stamp: 0
    node._measure(950, READING, 1)
    assert len(asked) == 3
    node._last, node._grid.jumps = 900, lambda stamp: True
    node._measure(1_900, READING, 1)
    assert calls == [("shift", 1_000), "forget"] and (node._last, node._restarts) == (0, 1)


def test_the_report_has_the_state_and_its_warnings(made):
    node, _, _, _ = made
    report = node._report()
    assert (report.level, report.summary) == (OK, "running") and node._squares == []
    assert report.values == {
        "desired": "1.500", "torque_command": "4.000", "error_rms": "3.1623",
        "disturbance_and_error": "0.500", "compensation": "0.250", "commands": 0,
        "missed_measurements": 0, "unusable_measurements": 2,
        "limited_commands": 0, "late_commands": 0, "feedback_share": "0.75", "restarts": 0,
        "link": "not used: link is false", "clock": "fine", "crossover_hz": "30.00",
        "phase_margin_deg": "45.0", "gain_margin_db": "8.0", "delay_margin_samples": "1.25",
        "desired_watchdog_trips": 3, "refused_desired": 4, "ignored_desired": 0,
        "ignored_measurements": 0,
    }  # fmt: skip
    assert node._report().values["error_rms"] == "none"
    node._limits.contradiction = "ft 10, K times deflection 15.8 N·m contradict each other"
    assert node._report()[:2] == (WARN, node._limits.contradiction)
    node._limits.contradiction = ""
    node._inputs.senders["desired torques"].ignored = 3
    node._inputs.senders["wrenches"].ignored = 2
    told = "2 wrenches of a second publisher ignored; 3 desired torques of a second publisher ignored"
    assert node._report()[:2] == (WARN, told)
    node._late = 5
    assert node._report()[:2] == (WARN, "5 commands more than a sample late, with less feedback")
    assert node._report().level == OK
    node._polarity.proven = False
    pulses = "pulses of torque without feedback: signs of ft, joint_states and motor torque are open"
    assert node._report()[:2] == (WARN, pulses)
    node._wished = False
    assert node._report()[:2] == (OK, "waiting for desired_torque")
    node._late = 7
    said = "waiting for desired_torque; 2 commands more than a sample late, with less feedback"
    assert node._report()[:2] == (WARN, said)
    node._last = 0
    assert node._report()[:2] == (WARN, "waiting for joint_states and ft")
    node._fault = "broken"
    assert node._report()[:2] == (ERROR, "broken")


def test_a_loss_of_the_links_encoder_is_told_while_it_lasts(made):
    node, _, _, _ = made
    encoder = SimpleNamespace(losses=0, trouble="deflection is off", used=False)
    node._link = SimpleNamespace(encoder=encoder)
    assert list(node._loss_words()) == []
    encoder.losses = 1
    for _ in range(2):
        assert list(node._loss_words()) == ["without the link's motion: deflection is off"]
    encoder.used = True
    assert list(node._loss_words()) == []
    encoder.losses, encoder.trouble = 2, ""
    assert list(node._loss_words()) == ["without the link's motion: deflection was lost for a moment"]
    encoder.used = False
    assert list(node._loss_words()) == []


def test_a_command_for_a_late_measurement_acts_in_the_next_cycle_all_the_same(made):
    """Measurements are 0.3 periods behind their cycle, one in ten 0.7: its command acted a cycle later."""
    node, _, out, _ = made
    node._grid, steps = Grid(float(PERIOD)), count(1)
    node._controller.step = lambda *a, **k: float(next(steps))
    queue, acted = CommandQueue(strict=True), []
    for cycle in range(5_000 * MS, 5_600 * MS, PERIOD):
        queue.take(cycle + PERIOD // 2)
        acted.append(queue.torque)
        stamp = cycle + (7 if len(acted) % 10 == 0 else 3) * MS
        node._measure(stamp, READING, 1)
        queue.add(*out[-1], stamp)
    assert acted == [float(k) for k in range(60)]
