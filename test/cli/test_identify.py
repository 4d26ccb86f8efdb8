"""simulate and identify one after another, and commands that they suggest; test/golden has what they say."""

import argparse
import json
import shlex
from pathlib import Path

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import TopicMap, write_record
from rsea_ros.cli import diagnose, identify
from rsea_ros.cli._options import rig_choice, topic_map
from rsea_ros.cli.main import attach_axis, main
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.remark_words import command

RIG = "paper_high_impedance"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("simulated") / "run"
    assert main(["simulate", RIG, "--duration", "6", "--seed", "5", "--out", str(path)]) == 0
    return path


def test_identify_opens_with_whether_the_model_fits(bag, tmp_path, capsys):
    """Where the motor constant is off, the intervals know that it may be."""
    assert main(["identify", str(bag), "--out", str(tmp_path / "out"), "--fail-on", "misfit"]) == 0
    assert capsys.readouterr().out.startswith("The model fits: ")
    misfitting, effect = tmp_path / "misfitting", ["--effect", "torque_constant_error:gain=1.1"]
    assert main(["simulate", RIG, "--duration", "6", "--seed", "6", *effect, "--out", str(misfitting)]) == 0
    assert main(["identify", str(misfitting), "--out", str(tmp_path / "bad"), "--fail-on", "misfit"]) == 1
    written = json.loads((tmp_path / "bad" / "identification.json").read_text(encoding="utf-8"))
    assert written["verdict"] == "misfit" and "torque_constant_error" in written["alternatives"]
    low, high = written["parameters"]["spring.stiffness"]["ci95"]
    assert low < load_rig(RIG)["spring.stiffness"] < high


def test_several_bags_make_one_result(bag, tmp_path, capsys):
    other = tmp_path / "other"
    assert main(["simulate", RIG, "--duration", "5", "--seed", "6", "--out", str(other)]) == 0
    assert main(["identify", str(bag), str(other), "--out", str(tmp_path / "both"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out.partition("\n")[2])["data"]
    assert data["bags"] == [str(bag), str(other)]
    assert data["duration_s"] == pytest.approx(11.0, abs=0.1)


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
    torque = 15.0 * np.random.default_rng(4).standard_normal(1400)
    bench = rsea.load_rig("paper_high_impedance").with_effect("backlash", gap=4e-3)
    write_record(rsea.simulate(bench, torque, 280.0), Path("run.mcap"), TopicMap(axis="torque.x"))
    options = ["--axis=torque.x", "--from=1.0"]
    assert main(["identify", "run.mcap", "--out", "fitted", *options]) == 0
    following = f"rsea diagnose run.mcap --rig paper_high_impedance {' '.join(options)}"
    assert f"next: {following}\n" in capsys.readouterr().out
    assert json.loads(Path("fitted/identification.json").read_text(encoding="utf-8"))["next"] == following
