"""overlay.mcap as other tools read it, and the layouts that show it."""

import functools
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

LAYOUTS = Path(__file__).resolve().parents[3] / "config" / "layouts"


TENTH = slice(None, None, 10)
"""Of the messages of a topic, one in so many is decoded: by pure Python, which is slow."""


@functools.cache
def messages(path: Path) -> dict[str, list[Any]]:
    """Return every tenth message of a bag by topic, read by rosbags itself."""
    read: dict[str, list[bytes]] = {}
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            read.setdefault(f"{connection.topic} {connection.msgtype}", []).append(raw)
        return {key: [reader.deserialize(raw, key.split()[1]) for raw in raws[TENTH]]
            for key, raws in read.items()}


def stamps(read: list[Any]) -> list[int]:
    return [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in read]


def test_overlay_reads_back_as_the_arrays_with_the_stamps_of_the_record(diagnosed) -> None:
    read = messages(diagnosed.out / "overlay.mcap")
    simulations = {
        "/simulated_before": diagnosed.diagnosis.before,
        "/simulated_after": diagnosed.diagnosis.after,
    }
    arrays = {"": {n: (c.t, c.y) for n, c in diagnosed.record.channels.items()}}
    arrays |= {ns: {o.channel: (o.t, o.simulated) for o in os} for ns, os in simulations.items()}
    for namespace, channels in arrays.items():
        wrenches = read[f"/rsea{namespace}/ft geometry_msgs/msg/WrenchStamped"]
        states = read[f"/rsea{namespace}/joint_states sensor_msgs/msg/JointState"]
        expected = diagnosed.record.epoch_ns + np.rint(channels["ft"][0] * 1e9).astype(np.int64)
        assert stamps(wrenches) == stamps(states) == expected[TENTH].tolist()
        assert np.array_equal([m.wrench.torque.z for m in wrenches], channels["ft"][1][TENTH])
        fields = {"position": "position", "velocity": "velocity", "effort": "motor_torque"}
        for field, name in fields.items():
            assert np.array_equal([getattr(m, field)[0] for m in states], channels[name][1][TENTH])
        assert {m.name[0] for m in states} == {"joint"}
    command = read["/rsea/torque_command sensor_msgs/msg/JointState"]
    assert np.array_equal([m.effort[0] for m in command], diagnosed.record["command"].y[TENTH])


def plottable(diagnosed) -> set[str]:
    """Return every series of the overlay as PlotJuggler names it."""
    series = set()
    for key in messages(diagnosed.out / "overlay.mcap"):
        topic, kind = key.split()
        fields = ("position", "velocity", "effort") if kind.endswith("JointState") else ()
        series |= {f"{topic}/joint/{field}" for field in fields}
        series |= {f"{topic}/wrench/torque/{axis}" for axis in "xyz" if kind.endswith("WrenchStamped")}
    return series


def test_plotjuggler_layout_shows_series_of_the_overlay(diagnosed) -> None:
    root = ET.parse(LAYOUTS / "plotjuggler_overlay.xml").getroot()
    snippets = {s.get("name"): s for s in root.iter("snippet")}
    curves = [c.get("name") for c in root.iter("curve")]
    sources = [s.findtext("linked_source") for s in snippets.values()]
    sources += [v.text for s in snippets.values() for v in s.find("additional_sources")]
    assert len(snippets) == 2 and set(snippets) <= set(curves)
    assert {c for c in curves if c not in snippets} | set(sources) <= plottable(diagnosed)
    assert sum(c.endswith("wrench/torque/z") for c in curves) == 3


def test_foxglove_layout_shows_topics_of_the_overlay(diagnosed) -> None:
    layout = json.loads((LAYOUTS / "foxglove_overlay.json").read_text(encoding="utf-8"))
    topics = {key.split()[0] for key in messages(diagnosed.out / "overlay.mcap")}
    paths = [p["value"] for panel in layout["configById"].values() for p in panel["paths"]]
    assert {path.split(".")[0] for path in paths} <= topics
    assert {path.split(".", 1)[1] for path in paths} == {
        "wrench.torque.z", "position[0]", "velocity[0]", "effort[0]"
    }  # fmt: skip
    assert set(re.findall(r'"(Plot![a-z]+)"', json.dumps(layout["layout"]))) == set(layout["configById"])
