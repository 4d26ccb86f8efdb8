"""Each export, and its file, lists every effect of the catalogue as exported or as left out."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from functools import partial

import pytest

from rsea_extras.exports.bam import export_bam
from rsea_extras.exports.feedforward import export_feedforward
from rsea_extras.exports.isaac import export_isaac
from rsea_extras.exports.urdf import export_sdf, export_urdf
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.exports.mjcf import export_mjcf
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig

EXPORTS = {
    "bam": export_bam, "isaac": export_isaac, "mjcf": export_mjcf, "sdf": export_sdf, "urdf": export_urdf,
    "feedforward": partial(export_feedforward, suffix=".h"),
}  # fmt: skip
FEWEST = {"mjcf": 15, "sdf": 3, "urdf": 3, "isaac": 5, "bam": 4, "feedforward": 12}
"""Effects that a target has words for, and so must not leave out."""


def rigs_with(name):
    for base in ("paper_high_impedance", "paper_moving_output"):
        effect = catalogue()[name]
        if not (name == "gravity_error" and base == "paper_high_impedance") and not (
            name == "base_compliance" and base == "paper_moving_output"
        ):
            yield load_rig(base).with_effects(EffectSetting(name, {**effect.null, **effect.typical}))


@pytest.mark.parametrize("target", EXPORTS)
def test_every_effect_is_exported_or_reported_as_left_out(target):
    said_effects = set()
    for name in catalogue():
        for rig in rigs_with(name):
            made = EXPORTS[target](rig)
            represented, omitted = list(made.says), list(made.leaves_out)
            assert (name in represented) != (name in omitted), (name, rig.name)
            assert name in made.content
            said_effects |= {name} & set(represented)
    assert len(said_effects) >= FEWEST[target], sorted(said_effects)


def test_isaac_lab_gets_the_fields_of_its_class(monkeypatch):
    """The stand-in has the fields of isaaclab.actuators.DelayedPDActuatorCfg, version 2.3."""
    import sys
    import types

    def DelayedPDActuatorCfg(
        joint_names_expr, effort_limit, stiffness, damping, armature, friction, dynamic_friction,
        viscous_friction, min_delay, max_delay, velocity_limit=None,
    ):  # fmt: skip
        return dict(locals())

    module = types.ModuleType("isaaclab.actuators")
    module.DelayedPDActuatorCfg = DelayedPDActuatorCfg
    monkeypatch.setitem(sys.modules, "isaaclab", types.ModuleType("isaaclab"))
    monkeypatch.setitem(sys.modules, "isaaclab.actuators", module)
    rig = load_rig("pd_joint").with_effect("stribeck_friction").with_effect("command_delay", delay=0.02)
    held: dict[str, object] = {}
    exec(export_isaac(rig).content, held)
    values = held["ACTUATOR"]
    assert (values["stiffness"], values["damping"], values["effort_limit"]) == (20.0, 0.6, 6.0)
    assert (values["friction"], values["dynamic_friction"], values["viscous_friction"]) == (3.5, 1.5, 0.5)
    assert (values["armature"], values["min_delay"], values["max_delay"]) == (0.02, 4, 4)


NAMES = {
    "m1": {"friction_base"},
    "m2": {"friction_base", "friction_stribeck", "dtheta_stribeck", "alpha"},
    "m3": {"friction_base", "load_friction_base"},
    "m4": {
        "friction_base", "friction_stribeck", "dtheta_stribeck", "alpha", "load_friction_base",
        "load_friction_stribeck",
    },
    "m5": {
        "friction_base", "friction_stribeck", "dtheta_stribeck", "alpha", "load_friction_motor",
        "load_friction_external", "load_friction_motor_stribeck", "load_friction_external_stribeck",
    },
}  # fmt: skip
NAMES["m6"] = NAMES["m5"] | {"load_friction_motor_quad", "load_friction_external_quad"}


@pytest.mark.parametrize(
    ("model", "effects"),
    [
        ("m1", {"coulomb_friction": {}}),
        ("m2", {"stribeck_friction": {}}),
        ("m3", {"load_dependent_friction": {}}),
        ("m4", {"load_dependent_friction": {}, "stribeck_friction": {}}),
        ("m5", {"directional_load_friction": {}}),
        ("m6", {"directional_load_friction": {"quadratic": 0.02}}),
    ],
)
def test_bam_gets_the_parameters_of_its_model(model, effects):
    """The names are those that bam/model.py reads for each model; it ignores any other."""
    rig = load_rig("pd_joint")
    for name, parameters in effects.items():
        rig = rig.with_effect(name, **parameters)
    values = json.loads(export_bam(rig, "mx106").content)
    always = {"model", "actuator", "armature", "q_offset", "friction_viscous", "rsea"}
    assert set(values) == NAMES[model] | always
    assert (values["model"], values["actuator"], values["armature"]) == (model, "mx106", 0.02)


@pytest.mark.parametrize(("motor", "load"), [(3.0, 1.0), (1.0, 3.0), (-2.0, -0.5)])
def test_bams_friction_budget_equals_ours_at_speed(motor, load):
    """BAM's loss for M6, as in its paper, is the size of our friction by direction."""
    p = {"motor_coefficient": 0.2, "load_coefficient": 0.07, "quadratic": 0.03}
    rig = load_rig("pd_joint").with_effect("directional_load_friction", **p)
    v = json.loads(export_bam(rig).content)
    external, fade = -load, 1.0  # M6 fades its quadratic part with speed; this speed is below that
    assert v["dtheta_stribeck"] > 1e6
    loss = v["friction_base"] + abs(external * v["load_friction_external"] - motor * v["load_friction_motor"])
    quad = v["load_friction_external_quad"] * external**2 if abs(external) < abs(motor) else 0.0
    quad += v["load_friction_motor_quad"] * motor**2 if abs(external) > abs(motor) else 0.0
    ours = abs(p["motor_coefficient"] * motor + p["load_coefficient"] * load)
    ours += p["quadratic"] * min(abs(motor), abs(load)) ** 2
    assert loss + fade * quad == pytest.approx(ours)


TURNS = {"harmonic_circular_spline_held": -160, "harmonic_flexspline_held": 161, "star": -159, "spur": -160}


@pytest.mark.parametrize("export", [export_isaac, export_bam])
@pytest.mark.parametrize("train", TURNS)
def test_one_joint_has_the_rotor_at_the_output_and_says_that_its_spin_is_left_out(export, train):
    """A rotor of J_r and n turns weighs n^2 J_r at the joint; its spin n J_r couples it to the housing."""
    rig, n = replace(load_rig("prototype_knee"), train=train), TURNS[train]
    made = export(rig)
    (armature,) = re.findall(r"armature\W+([0-9.e-]+)", made.content.split("ACTUATOR")[-1])
    assert float(armature) == pytest.approx(1.2 * n**2 / 160**2)
    left = made.leaves_out
    assert f"n = {n}" in left["gear.train"]
    assert f"{n * 1.2 / 160**2:.3g} kg·m²" in left["gear.train"]
    assert "0.0006169 kg·m²" in left["chassis.inertia"]
    assert f"n = {n}" in made.content


@pytest.mark.parametrize("export", [export_isaac, export_bam])
def test_a_lumped_rotor_has_no_spin_to_leave_out(export):
    made = export(replace(load_rig("prototype_knee"), train="lumped"))
    assert "gear.train" not in made.leaves_out


@pytest.mark.parametrize("target", EXPORTS)
def test_an_effect_at_its_null_value_is_not_exported(target):
    """A model.yaml may hold effects at their null values, and a file cannot hold an infinite limit."""
    rig = load_rig("paper_high_impedance")
    idle = rig.with_effects(*(EffectSetting(n, e.null) for n, e in catalogue().items()))
    assert EXPORTS[target](idle).content == EXPORTS[target](rig).content
    half = rig.with_effects(EffectSetting("voltage_sag", {"limit": 10.0, "no_load_speed": math.inf}))
    made = EXPORTS[target](half)
    assert [name for name, why in made.leaves_out.items() if "inf" in why] == ["voltage_sag"]


@pytest.mark.parametrize("target", [n for n in EXPORTS if n != "feedforward"])  # whose inputs are computed
def test_a_sensor_that_is_read_late_is_left_out_by_name(target):
    rig = load_rig("paper_high_impedance")
    late = replace(rig, sensors={**rig.sensors, "ft": replace(rig.sensors["ft"], delay=4e-3)})
    made = EXPORTS[target](late)
    assert "4 ms" in made.leaves_out["sensors.ft.delay"]
    assert not any("delay" in name for name in EXPORTS[target](rig).leaves_out)
