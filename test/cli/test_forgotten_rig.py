"""A rig that is not the bench's, because `--rig` was forgotten: every verb names it and asks."""

from __future__ import annotations

import json

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import write_record
from rsea_ros.cli.main import main
from rsea_ros.model.rig_file import load_rig, save_rig

RIG = "paper_high_impedance"
STATED = load_rig(RIG)["spring.stiffness"]
TRUE = 1.3 * STATED


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A bag of a bench with a spring 30 % stiffer than the default rig's, and the rig of that bench."""
    place = tmp_path_factory.mktemp("bench")
    bench = load_rig(RIG).with_values({"spring.stiffness": TRUE})
    command = 15.0 * np.random.default_rng(4).standard_normal(2800)
    write_record(rsea.simulate(bench, command, 280.0, seed=4), place / "run.mcap")
    save_rig(bench, place / "mine.yaml")
    return place


@pytest.fixture
def play(folder, monkeypatch, capsys):
    """A function that calls a verb and returns its status and what it printed."""

    def call(*words):
        monkeypatch.chdir(folder)
        status = main(list(words))
        return status, capsys.readouterr().out

    return call


def only(sentence):
    """Return text in one line."""
    return " ".join(sentence.split())


def test_diagnose_names_the_default_rig_and_asks_whether_it_is_right(folder, play):
    """It said "Nothing is wrong with the simulation" of a spring 30 % off, and named no rig."""
    status, printed = play("diagnose", "run.mcap", "--out", "why", "--fail-on", "off_rig")
    assert status == 1
    lines = printed.splitlines()
    assert "othing is wrong" not in printed
    assert only(printed).startswith("The structure of the simulation fits: ")
    assert "1 value differs from the rig" in only(" ".join(lines[:2]))
    assert f"rig         {RIG} (the default: no --rig was given)" in lines
    differs = "spring.stiffness differs from the rig: the rig states 1530 N·m/rad, the fit gives 19"
    assert differs in only(printed)
    assert "Is this the right rig? If not, name yours with --rig" in only(printed)
    assert f"            rsea identify run.mcap --rig {RIG}" in lines
    said = json.loads((folder / "why" / "diagnosis.json").read_text(encoding="utf-8"))
    assert (said["verdict"], said["rig"], said["rig_is_default"]) == ("nothing_wrong", RIG, True)
    (off,) = said["off_rig"]
    assert off["name"] == "spring.stiffness" and off["unit"] == "N m/rad"
    assert off["rig"] == pytest.approx(STATED) and off["ci95"][0] < TRUE < off["ci95"][1]
    assert off["spreads"] == pytest.approx(np.log(1.3) / 0.05, rel=0.01)
    assert "1 value differs from the rig" in said["sentence"] and "othing is wrong" not in said["sentence"]
    page = (folder / "why" / "report.html").read_text(encoding="utf-8")
    assert "Values that differ from the rig" in page and "the default: no --rig was given" in page


def test_identify_says_so_too_and_has_the_rig_with_the_fitted_values(play):
    status, printed = play("identify", "run.mcap", "--out", "fitted", "--fail-on", "off_rig")
    assert status == 1
    assert f"times the noise (default rig {RIG}); 1 value differs from the rig" in only(printed)
    assert "continue with --rig fitted/model.yaml" in only(printed)
