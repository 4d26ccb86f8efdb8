"""Commands that a verb suggests read the same data as the verb itself: they keep the options of its call."""

from __future__ import annotations

import argparse
import json
import shlex
from pathlib import Path

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import TopicMap, write_record
from rsea_ros.cli import diagnose, identify
from rsea_ros.cli._topics import rig_choice, topic_map
from rsea_ros.cli.main import attach_axis, main
from rsea_ros.report.remark_words import command

OPTIONS = [
    ["--axis=-torque.x", "--window", "5:20"],
    ["--namespace", "/left arm", "--joint", "elbow 1", "--from", "2.5"],
    ["--topic", "ft=/sensor/wrench", "--topic", "deflection=/q s", "--shift", "ft=-0.002", "--to", "9"],
    ["--from", "-1", "--rig", "my rig.yaml", "--window=-3:4"],
    [],
]


def parse(verb, words):
    parser = argparse.ArgumentParser()
    verb.add_arguments(parser)
    return parser.parse_args(attach_axis(words))


@pytest.mark.parametrize("options", OPTIONS)
def test_a_suggested_command_reads_the_same_data(options):
    """After `identify --axis=-torque.z --window 5:20`, `diagnose BAG` was suggested: other data."""
    given = parse(identify, ["a b.mcap", *options])
    words = shlex.split(command("diagnose", given.bags, "bench", rig_choice(given)))
    assert words[:2] == ["rsea", "diagnose"]
    again = parse(diagnose, words[2:])
    for name in ("bags", "rig", "namespace", "topic", "joint", "axis", "shift", "begin", "end", "window"):
        assert getattr(again, name) == getattr(given, name), name
    if " " not in given.namespace and not given.topic:
        assert topic_map(again) == topic_map(given)


def test_a_verb_prints_and_writes_the_command_with_its_options(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    torque = 15.0 * np.random.default_rng(4).standard_normal(2800)
    bench = rsea.load_rig("paper_high_impedance").with_effect("backlash", gap=4e-3)
    write_record(rsea.simulate(bench, torque, 280.0), Path("run.mcap"), TopicMap(axis="torque.x"))
    options = ["--axis=torque.x", "--from=1.0"]
    assert main(["identify", "run.mcap", "--out", "fitted", *options]) == 0
    following = f"rsea diagnose run.mcap --rig paper_high_impedance {' '.join(options)}"
    assert f"next: {following}\n" in capsys.readouterr().out
    assert json.loads(Path("fitted/identification.json").read_text(encoding="utf-8"))["next"] == following
