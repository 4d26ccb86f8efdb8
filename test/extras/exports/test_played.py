"""Exports that run here: MuJoCo and an FMU play the command of our simulation; the difference is measured."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest

from rsea_extras.exports.fmu import export_fmu, play_fmu
from rsea_ros.cli.main import main
from rsea_ros.design.mujoco_model import STEP, model_element
from rsea_ros.errors import RigError
from rsea_ros.exports import verification
from rsea_ros.exports.mjcf import export_mjcf
from rsea_ros.exports.verification import RATE, differences, ours, play_mujoco
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.rival_models import lumped_rig

MUJOCO = pytest.mark.skipif(
    sys.version_info < (3, 11), reason="MuJoCo 4 has no wheel for Python 3.10: nothing is played in it there"
)


def command(seconds):
    t = np.arange(round(seconds * RATE)) / RATE
    return 12.0 * (np.sin(2 * np.pi * 3.0 * t) + 0.5 * np.sin(2 * np.pi * 17.0 * t))


def share_lost(nominal, rig):
    """Return the largest difference of MuJoCo in a channel, as a share of the effects' size."""
    given = command(0.25)
    mine, without = ours(rig, given), ours(nominal, given)
    size = {one.channel: one.times_noise for one in differences(rig, mine, without)}
    assert min(size.values()) > 3.0
    left = apart(rig)
    return max(left[channel] / size[channel] for channel in ("ft", "position"))


def apart(rig):
    """Return the difference of each channel in times the noise."""
    given = command(0.25)
    theirs = play_mujoco(export_mjcf(rig).content, rig, given)
    return {one.channel: one.times_noise for one in differences(rig, ours(rig, given), theirs)}


@MUJOCO
@pytest.mark.parametrize(
    ("name", "values", "train"),
    [
        ("paper_high_impedance", {}, None),
        ("paper_moving_output", {"housing_end.gravity": 5.0, "gear.stiffness": 1e4}, "star"),
        ("prototype_knee", {}, None),
        ("two_moving_outputs", {}, "spur"),
        ("separate_stiffnesses", {}, "star"),
    ],
)
def test_a_nominal_rig_moves_alike_in_mujoco(name, values, train):
    """The knee's rotor turns at -160; the engine is given only bodies, springs and teeth."""
    rig = load_rig(name).with_values(values)
    assert max(apart(replace(rig, train=train or rig.train)).values()) < 0.01


def test_a_rig_that_mujoco_cannot_represent_is_refused():
    with pytest.raises(RigError, match="a rigid spring cannot be exported"):
        model_element(load_rig("bare_drive"))
    with pytest.raises(RigError, match="lumped train cannot be exported"):
        model_element(lumped_rig(load_rig("paper_moving_output")))
    with pytest.raises(RigError, match="chassis has inertia 0 kg·m²"):
        model_element(load_rig("paper_moving_output").with_values({"chassis.inertia": 0.0}))


SHARE = {"spring_hysteresis": 0.25, "stribeck_friction": 0.15, "asymmetric_friction": 0.05}
"""Of an effect's size that may be lost in MuJoCo's terms; a twentieth where nothing is said."""


@MUJOCO
@pytest.mark.parametrize(
    "name",
    [
        "command_delay", "current_loop_lag", "torque_saturation", "torque_constant_error", "coulomb_friction",
        "stribeck_friction", "lugre_friction", "quadratic_drag", "nonlinear_spring", "lopsided_spring",
        "hard_stop", "spring_hysteresis", "torque_ripple", "backlash", "voltage_sag", "gear_compliance",
        "base_compliance",
    ],
)  # fmt: skip
def test_an_exported_effect_acts_alike_in_mujoco(name):
    rig = load_rig("paper_high_impedance")
    assert share_lost(rig, rig.with_effect(name)) < SHARE.get(name, 0.05)


@MUJOCO
def test_several_effects_beside_free_ends_act_alike_in_mujoco():
    nominal = load_rig("paper_moving_output")
    rig = nominal.with_effect("backlash").with_effect("torque_ripple").with_effect("quadratic_drag")
    assert share_lost(nominal, rig.with_effect("torque_saturation").with_effect("command_delay")) < 0.05


@MUJOCO
@pytest.mark.parametrize("other", ["torque_constant_error", "current_loop_lag", "torque_saturation"])
def test_an_effect_that_conflicts_with_another_is_left_out_entirely(other):
    """The actuator was already a dcmotor when its gain was refused."""
    both = load_rig("paper_high_impedance").with_effect("voltage_sag", limit=5.0).with_effect(other)
    made = export_mjcf(both)
    left = made.leaves_out.keys() & {"voltage_sag", other}
    said = both.with_effects(*(one for one in both.effects if one.name not in left))
    given = command(0.25)
    theirs = play_mujoco(made.content, both, given)
    assert max(one.times_noise for one in differences(said, ours(said, given), theirs)) < 1.0


@MUJOCO
def test_a_long_excitation_is_played_in_pieces(monkeypatch):
    """One call took minutes, in which no signal was served; the pieces are one motion."""
    from mujoco import rollout

    rig, given, played, sizes = load_rig("paper_moving_output"), command(0.25), rollout.rollout, []

    def count(model, data, state, control, **more):
        sizes.append(control.shape[1])
        return played(model, data, state, control, **more)

    whole = play_mujoco(export_mjcf(rig).content, rig, given)
    monkeypatch.setattr(rollout, "rollout", count)
    monkeypatch.setattr(verification, "PIECE", 20)
    pieces = play_mujoco(export_mjcf(rig).content, rig, given)
    hold = round(1.0 / RATE / STEP)
    assert sizes == [20 * hold] * 3 + [(len(given) - 60) * hold]
    assert all(np.array_equal(pieces[name], y) for name, y in whole.items())


@MUJOCO
def test_a_model_that_diverges_is_reported_and_leaves_no_log(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    stiff = "lugre_friction:coulomb_torque=50,bristle_stiffness=1e8,bristle_damping=0"
    arguments = ["export", "--mjcf", "paper_high_impedance", "--effect", stiff, "--duration", "0.5"]
    status = main([*arguments, "--limit", "1"])
    assert status in (1, 2)
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()
    assert capsys.readouterr().err.count("\n") == (1 if status == 2 else 0)


@MUJOCO
def test_the_limit_is_an_exit_status(tmp_path, capsys):
    arguments = ["export", "--mjcf", "paper_high_impedance", "--duration", "0.4", "--limit", "1", "--json"]
    assert main([*arguments, "--out", str(tmp_path / "a.xml")]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["difference"]["ft"]["times_noise"] < 0.01
    assert document["leaves_out"].keys() == {"sensor noise"}
    assert main([*arguments, "--effect", "ft_bias:bias=1", "--out", str(tmp_path / "b.xml")]) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["difference"]["ft"]["times_noise"] == pytest.approx(1.0 / 0.03, rel=0.01)
    assert document["leaves_out"]["ft_bias"] == "MuJoCo has no element for it"
    assert document["loss"]["ft_bias"]["times_noise"] == pytest.approx(1.0 / 0.03, rel=0.01)


@pytest.mark.parametrize("target", ["urdf", "sdf", "isaac", "bam", "feedforward"])
def test_what_an_omitted_effect_costs_is_printed_for_targets_that_do_not_run_here(target, tmp_path, capsys):
    arguments = ["--effect", "ft_bias:bias=0.6", "--effect", "backlash", "--out", str(tmp_path / "a")]
    assert main(["export", f"--{target}", "paper_high_impedance", *arguments, "--duration", "0.4"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    times = re.search(r"without ft_bias: ft differs by (\S+) times the sensor's noise", text)
    assert float(times[1]) == pytest.approx(0.6 / 0.03, rel=0.01)
    assert "without backlash: " in text
    asked = ["--limit", "1", "--out", str(tmp_path / "b")]
    assert main(["export", f"--{target}", "paper_high_impedance", *asked]) == 2
    assert "only --mjcf and --fmu are verified" in capsys.readouterr().err


@pytest.mark.parametrize(("target", "package"), [("mjcf", "mujoco"), ("fmu", "fmpy")])
def test_a_missing_package_is_one_line(target, package, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, package, None)
    out = tmp_path / "rig.out"
    assert main(["export", f"--{target}", "prototype_knee", "--out", str(out)]) == 0
    assert f"needs the package {package}" in " ".join(capsys.readouterr().out.split())
    assert out.exists()
    asked = ["--limit", "1", "--out", str(tmp_path / "b")]
    assert main(["export", f"--{target}", "prototype_knee", *asked]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "b").exists()


def test_an_fmu_plays_our_simulation_and_accepts_other_parameters(tmp_path):
    from fmpy import simulate_fmu
    from fmpy.validation import validate_fmu

    rig = load_rig("paper_high_impedance").with_effect("backlash").with_effect("ft_sensor_lag")
    file = tmp_path / "rig.fmu"
    file.write_bytes(export_fmu(rig).content)
    assert validate_fmu(str(file)) == []
    given = command(0.4)
    t = np.arange(len(given)) / RATE
    signal = np.array(list(zip(t, given, strict=True)), dtype=[("time", "f8"), ("torque_command", "f8")])
    changed = {"backlash.gap": 0.002, "spring.stiffness": 1200.0}
    other = rig.with_values({"spring.stiffness": 1200.0}).with_effects(
        *(EffectSetting("backlash", {"gap": 0.002}) if e.name == "backlash" else e for e in rig.effects)
    )
    for values, expected in (({}, rig), (changed, other)):
        result = simulate_fmu(
            str(file), stop_time=t[-1], step_size=1 / RATE, output_interval=1 / RATE, input=signal,
            start_values=values, output=["ft", "position", "velocity"],
        )  # fmt: skip
        theirs = {name: result[name] for name in ("ft", "position", "velocity")}
        differing = differences(expected, ours(expected, given), theirs)
        assert max(one.times_noise for one in differing) < 0.5


def test_drifts_of_an_fmu_come_to_their_size_over_its_duration():
    rig, given = load_rig("paper_high_impedance").with_effect("ft_drift", drift=3.0), command(0.25)
    theirs = play_fmu(export_fmu(rig).content, rig, given)
    (ft,) = (one for one in differences(rig, ours(rig, given), theirs) if one.channel == "ft")
    assert ft.times_noise < 1.0
