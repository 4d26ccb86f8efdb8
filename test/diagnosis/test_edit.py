"""The edit test: the right name survives its removal from the machine, a wrong one in its place does not."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from runs import trying

import rsea_ros as rsea
from rsea_ros.cli.main import main
from rsea_ros.diagnosis.edit import edited
from rsea_ros.records.record import Channel

SOUND = rsea.load_rig("paper_high_impedance").with_values(
    {"spring.stiffness": 1480.0, "rotor.reflected_damping": 25.0}
)
FRICTION = "coulomb_friction"
RUBBING = SOUND.with_effect(FRICTION, torque=3.0)


def run(rig, seed):
    return rsea.simulate(rig, 15.0 * np.random.default_rng(seed).standard_normal(1680), 280.0, seed=seed)


@pytest.fixture(scope="module")
def diagnosis():
    """What the test needs of a diagnosis that named the friction, and the rig that is fitted without it."""
    dense, levels = rsea.identify(run(RUBBING, 1), "paper_high_impedance").rig, {"ft": 0.03}
    return SimpleNamespace(
        causes=[SimpleNamespace(name=FRICTION, channel="ft")], extended_rig=RUBBING, baseline_rig=dense,
        noise_rms=levels, extended_residual_rms=levels,
    )  # fmt: skip


def test_the_right_name_survives_its_removal_and_bent_values_do_not(diagnosis):
    """Nothing is fitted: the values of the rig, fitted beside the cause, are those of the edited machine."""
    edit = edited(diagnosis, run(SOUND, 2), FRICTION)
    assert edit.survived and edit.channel == "ft" and edit.error_after < 1.1 * edit.noise
    assert edit.error_before > 10.0 * edit.error_after
    assert edit.error_dense_fit > 3.0 * edit.error_after, "its damping stands for the friction that is gone"


def test_a_name_that_was_not_taken_out_or_is_wrong_does_not_survive(diagnosis):
    assert edited(diagnosis, run(RUBBING, 2), FRICTION).outcome == "still_there"
    stiffer = SOUND.with_values({"spring.stiffness": 2000.0})
    assert edited(diagnosis, run(stiffer, 2), FRICTION).outcome in ("worse", "undecided")
    wrong = diagnosis.baseline_rig.with_effect(FRICTION, torque=1.0)
    of_wrong = SimpleNamespace(**{**vars(diagnosis), "extended_rig": wrong})
    assert not edited(of_wrong, run(SOUND, 2), FRICTION).survived
    with pytest.raises(rsea.RseaError, match="without cause backlash: not named by this diagnosis, expected"):
        edited(diagnosis, run(SOUND, 2), "backlash")


def test_faulty_samples_of_the_edited_run_do_not_count(diagnosis):
    """Four spikes of 80 N·m made "does not survive" of a machine that was right."""
    sound = run(SOUND, 2)
    spikes = sound["ft"].y + 80.0 * np.isin(np.arange(len(sound["ft"])), (150, 450, 750, 1100))
    edit = edited(diagnosis, sound.with_channels(ft=Channel(sound["ft"].t, spikes)), FRICTION)
    assert edit.survived and "outliers" in {fault.kind for fault in edit.faults}


def test_the_verb_writes_the_edit_and_keeps_its_results_where_the_cause_is_another(tmp_path, capsys):
    for name, rig, seed in (("run", RUBBING, 1), ("edited", SOUND, 2)):
        rsea.save(run(rig, seed), tmp_path / name)
    words = ["diagnose", str(tmp_path / "run"), "--edited", str(tmp_path / "edited")]
    words += ["--max-causes", "1", "--without", *trying(FRICTION).without]
    out = ["--out", str(tmp_path / "out"), "--without-cause"]
    assert main([*words, *out, FRICTION]) == 0
    assert "Coulomb friction survives its removal" in " ".join(capsys.readouterr().out.split())
    told = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["edit"]
    assert told["cause"] == FRICTION and told["error_after"] < told["error_dense_fit"]
    assert told["outcome"] == "survived" and told["unit"] == "N m"
    assert main([*words[:2], "--edited", "", "--without-cause", FRICTION]) == 2
    assert main(words) == 2
    assert "--edited BAG and --without-cause EFFECT: one is given" in capsys.readouterr().err
