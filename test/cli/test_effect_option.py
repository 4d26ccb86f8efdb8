"""`rsea simulate --effect`: an impossible effect is refused in one line, with value, bounds and unit."""

from __future__ import annotations

import pytest

from rsea_ros.cli.main import main

BOUNDS = "expected NAME:param=value with a number in SI (gap: 0 to 0.1 rad)"


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        (["backlash:gap=-1"], "effect backlash: gap = -1 rad, expected 0 to 0.1 rad"),
        (["backlash:gap=0.2"], "effect backlash: gap = 0.2 rad, expected 0 to 0.1 rad"),
        (["backlash:gap=nan"], f"--effect backlash:gap=nan: gap = 'nan', {BOUNDS}"),
        (["backlash:gap=inf"], f"gap = 'inf', {BOUNDS}"),
        (["backlash:gap=0x10"], f"gap = '0x10', {BOUNDS}"),
        (["backlash:gap=1_0"], f"gap = '1_0', {BOUNDS}"),
        (["backlash:gap=1:30"], f"gap = '1:30', {BOUNDS}"),
        (["backlash:gap=1e999"], f"gap = '1e999', {BOUNDS}"),
        (["backlash:gap"], f"gap = '', {BOUNDS}"),
        (["backlash:gap=1e-3,gap=2e-3"], "--effect backlash:gap=1e-3,gap=2e-3: gap is given twice"),
        (["backlash", "backlash:gap=1e-3"], "effect backlash is given twice, expected once"),
        (["backlash:width=1"], "effect backlash: unknown parameter 'width', expected gap"),
    ],
)
def test_a_senseless_effect_is_refused_in_one_line(effects, message, capsys, tmp_path):
    options = [part for effect in effects for part in ("--effect", effect)]
    rig = "paper_high_impedance"
    assert main(["simulate", rig, "--duration", "1", "--out", str(tmp_path / "x.mcap"), *options]) == 2
    error = capsys.readouterr().err
    assert error.startswith("rsea simulate: ") and message in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_an_effect_that_the_rig_states_cannot_be_given_again(capsys, tmp_path):
    options = ["--effect", "coulomb_friction", "--duration", "1", "--out", str(tmp_path / "x.mcap")]
    assert main(["simulate", "emps", *options]) == 2
    assert "effect coulomb_friction is given twice, expected once" in capsys.readouterr().err
