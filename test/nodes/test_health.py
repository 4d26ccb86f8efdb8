"""The health node: inputs, memory, messages, bags, and the file with the noise."""

import math

import numpy as np
import pytest

from msg_adapters import TopicMap, read_record
from msg_adapters.ros import OK, WARN, JointState, WrenchStamped, joint_state_message, wrench_message
from rsea_ros.errors import ParameterError
from rsea_ros.health.health_finding import NAMES, TABLE as CODES, HealthFinding
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes import health
from rsea_ros.nodes._joint_inputs import HealthInputs, noise_from
from rsea_ros.nodes._qos import COMMAND
from rsea_ros.nodes.health import FindingsPublisher, Keeper, Ring, instant, sentence

EPOCH, PERIOD = 1_700_000_000_000_000_000, round(1e9 / 280.0)
TOPICS = ("joint_states", "torque_command", "ft")
STATE = "sensor_msgs/msg/JointState"


@pytest.fixture
def heard(listener):
    """Inputs on topics of this process with a ring, and publishers of them."""
    ring = Ring(60.0, 1.0)
    inputs = HealthInputs(listener.node, "torque.z", "joint", ring.add)
    state, command, ft = (
        listener.node.create_publisher(kind, topic, COMMAND)
        for topic, kind in zip(TOPICS, (JointState, JointState, WrenchStamped), strict=True)
    )
    listener.until(lambda: all(p.get_subscription_count() for p in (state, command, ft)))
    return inputs, ring, state, command, ft


def take_all(inputs, listener, count):
    """Everything that is complete, once some messages have come."""
    rows = []

    def has_come():
        rows.append(inputs.take())
        return sum(inputs.counts.values()) + inputs.refused >= count

    listener.until(has_come)
    return tuple(np.concatenate(parts) for parts in zip(*rows, strict=True))


def test_events_are_sorted_strangers_are_refused_and_bags_can_be_read(heard, listener, tmp_path):
    inputs, ring, state, command, ft = heard
    for k in range(100):
        stamp = EPOCH + k * PERIOD
        ft.publish(wrench_message(stamp, (0.0,) * 5 + (0.1 * k,)))
        state.publish(joint_state_message(stamp, 1e-3 * k if k != 50 else math.nan, 0.0, 0.0))
        command.publish(joint_state_message(stamp, 0.0, 0.0, 1.0))
    state.publish(joint_state_message(EPOCH, 0.0, 0.0, 0.0, joint="elbow"))
    command.publish(joint_state_message(EPOCH, 0.0, 0.0, math.inf))
    t, kind, values = take_all(inputs, listener, 302)
    assert np.all(np.diff(t) >= 0.0) and len(t) > 3 * 60 and set(kind) == {0, 1, 2}
    assert np.isnan(values[kind == 0, 0]).sum() == 1 and inputs.refused == 2
    keeper = Keeper(ring, tmp_path / "kept", 1, 0.0)
    middle = sorted(m.at for m in ring.messages())[150]
    keeper.ask("RSEA_STIFFNESS", middle)
    listener.until(lambda: keeper.poll() is not None)
    assert keeper.last is not None
    assert len(read_record(keeper.last / "after", topics=TopicMap(namespace="/"), strict=False)["ft"]) > 20
    keeper.ask("RSEA_STIFFNESS", middle)
    keeper.poll()
    assert "holds 1, expected less than 1 (bags)" in keeper.trouble
    keeper.close()
    assert len(list((tmp_path / "kept").iterdir())) == 1


def test_stamps_of_another_time_restart_the_watch(heard, listener):
    inputs, _, state, _, _ = heard
    for first in (EPOCH, EPOCH - 3600 * 10**9):
        for k in range(60):
            state.publish(joint_state_message(first + k * PERIOD, 0.0, 0.0, 0.0))
        listener.until(lambda first=first: inputs.counts["joint_states"] >= (60 if first == EPOCH else 120)
                       or len(inputs.take()[0]) < 0)  # fmt: skip
    assert len(inputs._waiting) <= 60


def test_commands_to_a_joint_that_publishes_nothing_do_not_pile_up(heard, listener, monkeypatch):
    """They wait for measurements of their time: 280 a second for as long as these stopped."""
    monkeypatch.setattr("rsea_ros.nodes._joint_inputs.MOST", 50)
    inputs, _, _, command, _ = heard
    for k in range(120):
        command.publish(joint_state_message(EPOCH + k * PERIOD, 0.0, 0.0, 1.0))
    listener.until(lambda: len(inputs.take()[0]) == 0 and inputs.counts["torque_command"] >= 120)
    assert len(inputs._waiting) == 50


@pytest.mark.parametrize(
    ("text", "why"), [(None, "No such file or directory"), ("name: rig\n", "no JSON"), ("[1, 2]", "")]
)
def test_a_file_of_another_kind_is_refused_in_plain_words(tmp_path, text, why):
    """It said `[Errno 2] …` and `Expecting value: line 1 column 1 (char 0)`."""
    file = tmp_path / "file.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ParameterError) as caught:
        noise_from(load_rig("paper_high_impedance"), str(file))
    said = f": {why}" if why else ""
    assert str(caught.value).startswith(f"parameter identification = {str(file)!r}{said}, expected an ident")


NOWHERE = {"size": math.nan, "ci95": (math.nan, math.nan), "since": math.nan}


def finding(code="RSEA_PARAMETER_CHANGED", name="spring.stiffness", **changes):
    given = {
        "code": code, "name": name, "confidence": 0.98765, "size": -123.456, "unit": "N m/rad",
        "ci95": (-150.0, -100.25), "since": 2.0,
    } | changes  # fmt: skip
    return HealthFinding(**given)


def test_a_finding_is_a_line_with_its_size_and_range():
    assert sentence(finding()) == "spring.stiffness changed by -123.5 N·m/rad (-150 to -100.2)"
    assert sentence(finding(**NOWHERE)) == "spring.stiffness"
    assert sentence(finding(name="", **NOWHERE)) == "RSEA_PARAMETER_CHANGED"
    assert instant(1_735_689_600_123_456_789) == "2025-01-01T00:00:00.123+00:00"


@pytest.fixture
def published(listener):
    """Return a function that publishes findings and returns level, line and values of each code."""

    def publish(*findings):
        made, out = FindingsPublisher(listener.node, "hip", lambda: findings, lambda t: round(t * 1e9)), []
        made._publisher.publish = out.append
        made.publish()
        (message,) = out
        assert [s.name for s in message.status] == [f"/listener: {c.name}" for c in CODES]
        assert {s.hardware_id for s in message.status} == {"hip"}
        shown = [(s.level, s.message, {v.key: v.value for v in s.values}) for s in message.status]
        return dict(zip(NAMES, shown, strict=True))

    return publish


def test_every_code_without_a_finding_is_fine(published):
    assert all(row == (OK, "no", {"code": code}) for code, row in published().items())


def test_a_finding_has_its_values_and_two_of_a_code_their_names(published):
    code = CODES[0].name
    rest = {"unit": "N m/rad", "since": "1970-01-01T00:00:02.000+00:00"}
    values = {"confidence": "0.988", "size": "-123.46", "low": "-150", "high": "-100.25", **rest}
    severe = health.SEVERE
    level, said, shown = published(finding(code))[code]
    assert level == (health.ERROR if code in severe else WARN)
    assert said == sentence(finding(code)) and shown == {"code": code, "name": "spring.stiffness", **values}
    both = published(finding(code), finding(code, "gear", **NOWHERE))[code]
    assert both[1] == f"{sentence(finding(code))}; gear"
    assert both[2] == {
        "code": code, "gear.name": "gear", "gear.confidence": "0.988",
        **{f"spring.stiffness.{k}": v for k, v in {"name": "spring.stiffness", **values}.items()},
    }  # fmt: skip
    for frozen in severe:
        assert published(finding(frozen, "ft"))[frozen][0] == health.ERROR


def test_memory_keeps_the_newest_within_seconds_and_megabytes():
    ring = Ring(2.0, 1e-3)
    for k in range(5):
        ring.add("ft", "W", k * 10**9, bytes(100))
    assert [m.at for m in ring.messages()] == [2 * 10**9, 3 * 10**9, 4 * 10**9] and ring.size == 300
    ring.add("ft", "W", 4 * 10**9, bytes(700))
    assert ring.size == 1000 and len(ring.messages()) == 4
    ring.add("ft", "W", 4 * 10**9, bytes(1))
    assert ring.size == 901
    ring.add("ft", "W", 4 * 10**9, bytes(1001))
    assert ring.messages() == [] and ring.size == 0
    ring.add("ft", "W", 100 * 10**9, bytes(1))
    ring.add("ft", "W", 10**9, bytes(1))  # a clock that was set back
    assert [m.at for m in ring.messages()] == [10**9]


def test_bags_are_written_when_due_up_to_a_number(tmp_path, monkeypatch):
    now = [50.0]
    monkeypatch.setattr(health.time, "monotonic", lambda: now[0])
    written = []
    monkeypatch.setattr(health, "_write", lambda path, kept, since: written.append((kept, since)) or path)
    ring, folder = Ring(60.0, 1.0), tmp_path / "kept"
    ring.add("ft", "W", 7, b"x")
    keeper = Keeper(ring, folder, 1, 30.0)
    assert keeper.poll() is None
    keeper.ask("CODE", 5)
    now[0] = 60.0
    keeper.ask("OTHER", 6)
    now[0] = 79.9
    assert keeper.poll() is None and not written
    now[0] = 80.0
    keeper.poll()
    keeper._writing.result(5.0)
    done = keeper.poll()
    assert done == keeper.last and done.name.endswith("-CODE") and done.parent == folder
    assert written == [(ring.messages(), 5)] and keeper.poll() is None
    (folder / "one").mkdir(parents=True)
    (folder / "note.txt").touch()
    keeper.ask("CODE", 5)
    now[0] = 111.0
    assert keeper.poll() is None
    assert keeper.trouble == f"no bag kept: {folder} holds 1, expected less than 1 (bags)"

    def refuses(path, kept, since):
        raise OSError("disk full")

    monkeypatch.setattr(health, "_write", refuses)
    keeper._most = 2
    keeper.ask("CODE", 5)
    now[0] = 142.0
    keeper.poll()
    with pytest.raises(OSError, match="full"):
        keeper._writing.result(5.0)
    assert keeper.poll() is None and keeper.trouble == "no bag kept: disk full"
    monkeypatch.setattr(health, "_write", lambda path, kept, since: written.append((kept, since)) or path)
    keeper.ask("CODE", 9)
    keeper.close()
    assert written[-1][1] == 9
