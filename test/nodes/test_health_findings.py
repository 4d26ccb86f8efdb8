"""What health says of its findings and keeps of its memory, without ROS."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from rsea_ros.health.health_finding import TABLE as CODES, HealthFinding
from rsea_ros.nodes import health
from rsea_ros.nodes._health import OK, WARN
from rsea_ros.nodes.health import FindingsPublisher, Keeper, Ring, instant, sentence

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
def published(monkeypatch):
    """Return a function that publishes findings and returns the status of each code."""
    out = []
    monkeypatch.setattr(health, "statuses_message", lambda now, rows, joint: (rows, joint))
    node = SimpleNamespace(
        get_fully_qualified_name=lambda: "/rsea/health", create_timer=lambda *a, **k: None,
        create_publisher=lambda kind, topic, qos: SimpleNamespace(publish=out.append),
    )  # fmt: skip

    def publish(*findings):
        FindingsPublisher(node, "hip", lambda: findings, lambda t: round(t * 1e9)).publish()
        rows, joint = out[-1]
        assert joint == "hip" and [row[0] for row in rows] == [f"/rsea/health: {c.name}" for c in CODES]
        return {row[0].removeprefix("/rsea/health: "): row[1:] for row in rows}

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
