"""MJCF: the model, and its loop.

Source: MuJoCo 4.0 XML reference (actuator delay, filterexact, dcmotor; tendon stiffness and damping as
polynomials, springlength, springyield, frictionloss).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree as xml

from rsea_ros.design.mujoco_model import model_element, text
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.exports.chain import check_rotary
from rsea_ros.exports.mjcf_effects import EFFECTS, STRUCTURES, motor
from rsea_ros.exports.others import (
    Export,
    Omitted,
    Represented,
    Unrepresentable,
    coverage_comment,
    finite_sizes,
    without_null_effects,
)
from rsea_ros.model.equations import with_structure
from rsea_ros.model.rig import Rig


def say_loop(rig: Rig, root: xml.Element) -> tuple[Represented, list[Omitted]]:
    """Turn the motor into the loop's actuator; return exported and omitted parts."""
    if rig.loop is None:
        return Represented("motor", "motor on the tendon output - housing"), []
    gains = _gains(rig)
    first = motor(root)
    first.tag = "pid"
    del first.attrib["gainprm"]
    first.set("input", "pos")
    for name, value in gains.items():
        first.set(name, repr(value))
    limit = rig["controller.torque_limit"]
    if math.isfinite(limit):
        first.set("forcerange", f"{-limit!r} {limit!r}")
    how = "pid actuator, " + ", ".join(f"{name} {value:g}" for name, value in gains.items())
    return Represented(f"{rig.loop} loop", how), list(_omitted_terms(rig))


def _gains(rig: Rig) -> dict[str, float]:
    if rig.loop == "pd":
        named = {"kp": rig["controller.k_p"], "ki": rig["controller.k_i"], "kv": rig["controller.k_d"]}
    else:
        k_v = rig["controller.k_v"]
        named = {"kp": rig["controller.k_pos"] * k_v, "kv": k_v}
    return {name: value for name, value in named.items() if value}


def _omitted_terms(rig: Rig) -> Iterator[Omitted]:
    if rig.encoder_end == "spring_end":
        why = "an actuator's loop closes over its own tendon, that of the gear output"
        yield Omitted("encoder at the spring's end", why)
    for name, why in (
        ("sample_time", "the loop runs at the model's step"),
        ("velocity_limit", "slewmax limits the target, not what the loop asks"),
        ("k_f", "the setpoint has no feed-forward of its rate"),
        ("k_vi", "the integral is of the position's error"),
    ):
        value = rig.values().get(f"controller.{name}", 0.0)
        if value and math.isfinite(value):
            yield Omitted(f"controller.{name}", why)


def export_mjcf(rig: Rig) -> Export:
    """Return the model of a rig.

    Raises RigError for a rig that MJCF cannot represent (see design/mujoco_model.py).
    """
    check_rotary(rig)
    rig = without_null_effects(rig)
    finite = finite_sizes(rig)
    root = model_element(with_structure(rig), play_of(rig))
    loop, omitted = say_loop(rig, root)
    represented = [loop]
    for setting in sorted(rig.effects, key=lambda one: effect_named(one.name).order):
        parameters = effect_named(setting.name).complete(setting.parameters)
        try:
            if setting.name not in finite:
                raise Unrepresentable("a parameter of it is infinite")
            if setting.name in STRUCTURES:
                represented.append(Represented(setting.name, STRUCTURES[setting.name]))
            elif setting.name in EFFECTS:
                represented.append(Represented(setting.name, EFFECTS[setting.name](root, rig, parameters)))
            else:
                raise Unrepresentable("MuJoCo has no element for it")
        except Unrepresentable as reason:
            omitted.append(Omitted(setting.name, str(reason)))
    omitted += unsaid_of(rig)
    root.insert(0, coverage_comment(represented, omitted))
    return Export("mjcf", ".xml", text(root), tuple(represented), tuple(omitted))


def play_of(rig: Rig) -> float:
    """Return the play between gear output and chassis that the model has, rad."""
    gaps = [one.parameters["gap"] for one in rig.effects if one.name == "backlash"]
    return float(gaps[0]) if gaps else 0.0


def unsaid_of(rig: Rig) -> list[Omitted]:
    """Return the parts of the rig itself, without its effects, that the model leaves out."""
    noise = "sensors of MJCF are those of perfect instruments; the rig's noise and quanta stay with the rig"
    return [Omitted("sensor noise", noise)] if rig.sensors else []
