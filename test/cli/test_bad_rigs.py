"""Senseless rigs, effects and numbers: one line that says what and where, status 2, no partial files."""

from __future__ import annotations

import pytest
from bad_input import ROOT, assert_refused, rsea, without

from msg_adapters import write_record

RIG = (ROOT / "config/rigs/paper_high_impedance.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "value: 0.953",
            "value: -0.953",
            ("rotor.reflected_inertia = -0.953 kg·m²", "expected a finite value > 0"),
        ),
        ("value: 0.953", "value: heavy", ("rotor.reflected_inertia = 'heavy'", "expected a number (kg·m²)")),
        (
            "unit: kg m^2, spread",
            "unit: g m^2, spread",
            ("rotor.reflected_inertia.unit = 'g m^2'", "'kg m^2'"),
        ),
        ("chassis:", "chasis:", ("unknown key 'chasis'", "expected one of")),
        ("clamped: true", "clamped: 1", ("clamped = 1", "expected true or false")),
        (
            "known: [gear.ratio",
            "known: [gear.rate",
            ("known: 'gear.rate'", "expected a value that this rig states"),
        ),
    ],
)
def test_a_senseless_rig_is_refused_in_one_line(record, tmp_path, out, old, new, words):
    write_record(record, tmp_path / "bag")
    assert old in RIG
    (tmp_path / "rig.yaml").write_text(RIG.replace(old, new, 1), encoding="utf-8")
    assert_refused(
        rsea("identify", tmp_path / "bag", "--rig", tmp_path / "rig.yaml", "--out", out),
        tmp_path / "rig.yaml",
        *words,
    )


def test_a_rig_that_does_not_exist_is_refused(record, tmp_path, out):
    write_record(record, tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--rig", "papper", "--out", out)
    assert_refused(done, "rig 'papper' not found", "paper_high_impedance")


def test_a_rig_that_the_data_contradict_is_refused(record, tmp_path, out):
    write_record(without(record, "position"), tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--rig", "bare_drive", "--out", out)
    assert_refused(done, tmp_path / "bag", "no position channel, expected one")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--effect", "backlash:gap=wide"], ("--effect backlash:gap=wide", "expected NAME:param=value")),
        (["--effect", "warp"], ("effect 'warp'", "not in the catalogue")),
        (["--effect", "backlash:width=1"], ("backlash", "unknown parameter 'width'", "expected gap")),
        (["--duration", "-3"], ("duration = -3",)),
        (["--rate", "0"], ("rate = 0",)),
        (["--amplitude", "1e6"], ("100",)),
    ],
)
def test_a_senseless_simulation_is_refused(tmp_path, arguments, words):
    assert_refused(rsea("simulate", "paper_high_impedance", "--out", tmp_path / "bag", *arguments), *words)
    assert list(tmp_path.iterdir()) == []
