"""MJCF: the model, its loop, and effects in MuJoCo's terms: each changes the model and says how.

Source: MuJoCo 4.0 XML reference (actuator delay, filterexact, dcmotor; tendon stiffness and damping as
polynomials, springlength, springyield, frictionloss).
"""

import math
from collections.abc import Callable, Mapping
from xml.etree import ElementTree as xml

import numpy as np

from rsea_ros.design.mujoco_model import SOLIMP, SOLREF, STEP, model_element, text
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.exports import others
from rsea_ros.exports.verification import play_mujoco
from rsea_ros.model.equations import train_ratio, with_structure
from rsea_ros.model.rig import Rig

Parameters = Mapping[str, float]
Effect = Callable[[xml.Element, Rig, Parameters], str]

BRISTLE, BRISTLE_TIME = 5e-6, 2e-4
"""rad, and s for each rad/s of the Stribeck velocity: how far bristles bend that stand in for a friction
whose sign is smoothed. Shorter ones come nearer, and at speed their law outruns the model's step."""
ELEMENTS = 8
"""Elasto-plastic springs in parallel that stand in for a hysteresis."""


def tendon(root: xml.Element, name: str) -> xml.Element:
    """Return the sum of hinges of a name."""
    return next(one for one in root.iter("fixed") if one.get("name") == name)


def motor(root: xml.Element) -> xml.Element:
    """Return the actuator that the command drives, as the element that has every attribute."""
    first = next(root.iter("actuator"))[0]
    if first.tag == "motor":
        first.tag = "general"
        first.set("gainprm", "1")
    return first


def beside(root: xml.Element, name: str, like: str) -> xml.Element:
    """Add and return a sum of hinges of another name."""
    copy = xml.SubElement(next(root.iter("tendon")), "fixed", name=name)
    for joint in tendon(root, like):
        copy.append(xml.fromstring(xml.tostring(joint)))
    return copy


def passive(root: xml.Element, name: str, **attributes: str) -> xml.Element:
    """Add and return a dcmotor without input on the output: its friction or cogging alone."""
    fixed = {"name": name, "tendon": "motor", "input": "none", "motorconst": "0", "resistance": "1"}
    return xml.SubElement(next(root.iter("actuator")), "dcmotor", {**fixed, **attributes})


def _command_delay(root: xml.Element, rig: Rig, p: Parameters) -> str:
    if p["delay"] < STEP:
        step = f"the model's step of {STEP:g} s"
        raise others.Unrepresentable(f"a delay of {p['delay']:g} s is shorter than {step}")
    samples = math.ceil(p["delay"] / STEP) + 1
    motor(root).attrib.update(delay=repr(p["delay"]), nsample=str(samples), interp="zoh")
    return f"actuator delay {p['delay']:g} s"


def _current_loop_lag(root: xml.Element, rig: Rig, p: Parameters) -> str:
    if motor(root).tag != "general":
        raise others.Unrepresentable(f"the actuator is a {motor(root).tag}, which has no filter")
    motor(root).attrib.update(dyntype="filterexact", dynprm=repr(p["time_constant"]))
    return f"actuator dyntype filterexact, {p['time_constant']:g} s"


def _torque_saturation(root: xml.Element, rig: Rig, p: Parameters) -> str:
    name = "forcerange" if motor(root).tag == "pid" else "ctrlrange"
    limit = min(p["limit"], float(motor(root).get(name, "0 inf").split()[1]))
    motor(root).set(name, f"{-limit!r} {limit!r}")
    return f"actuator {name} {limit:g} N·m"


def _torque_constant_error(root: xml.Element, rig: Rig, p: Parameters) -> str:
    if motor(root).tag != "general":
        raise others.Unrepresentable(f"the actuator is a {motor(root).tag}, whose gain is that of its loop")
    motor(root).set("gainprm", repr(p["gain"]))
    return f"actuator gainprm {p['gain']:g}"


def _coulomb_friction(root: xml.Element, rig: Rig, p: Parameters) -> str:
    losses = {"frictionloss": repr(p["torque"]), "solreffriction": SOLREF, "solimpfriction": SOLIMP}
    tendon(root, "motor").attrib.update(losses)
    return f"tendon frictionloss {p['torque']:g} N·m; it sticks where the rig's creeps"


def _stribeck_friction(root: xml.Element, rig: Rig, p: Parameters) -> str:
    static = p["coulomb_torque"] + p["stribeck_torque"]
    stiffness = static / max(BRISTLE, BRISTLE_TIME * p["stribeck_velocity"])
    damping = 2.0 * math.sqrt(stiffness * rig["rotor.reflected_inertia"])  # the rotor's swing on its bristles
    return _lugre(root, "stribeck", stiffness, p, damping) + ", bristles in the place of creep"


def _lugre(root: xml.Element, name: str, stiffness: float, p: Parameters, damping: float) -> str:
    static = p["coulomb_torque"] + p["stribeck_torque"]
    law = (stiffness, damping, p["coulomb_torque"], static, p["stribeck_velocity"])
    passive(root, name, lugre=" ".join(map(repr, law)))
    return f"dcmotor lugre {law[0]:g} {law[1]:g} {law[2]:g} {law[3]:g} {law[4]:g}"


def _asymmetric_friction(root: xml.Element, rig: Rig, p: Parameters) -> str:
    if p["viscous_difference"]:
        raise others.Unrepresentable("damping is the same in both directions")
    bias = {"gainprm": "0", "biastype": "affine", "biasprm": f"{-p['offset']!r} 0 0"}
    xml.SubElement(next(root.iter("actuator")), "general", {"name": "offset", "tendon": "motor", **bias})
    return f"a second actuator with the constant bias {-p['offset']:g} N·m"


def _quadratic_drag(root: xml.Element, rig: Rig, p: Parameters) -> str:
    losses = tendon(root, "motor")
    losses.set("damping", f"{losses.get('damping', '0')} {p['coefficient']!r} 0")
    return f"tendon damping polynomial, {p['coefficient']:g} v|v|"


def _polynomial(root: xml.Element, rig: Rig, at: int, factor: float, power: str) -> str:
    spring = tendon(root, "spring")
    terms = [*spring.get("stiffness", "0").split(), "0", "0"][:3]
    terms[at] = repr(rig["spring.stiffness"] * factor)
    spring.set("stiffness", " ".join(terms))
    falls = "; beyond its turning point it falls, where the rig's stays level"
    turns = falls if factor < 0.0 or at == 1 else ""
    return f"tendon stiffness polynomial, {rig['spring.stiffness'] * factor:g} {power}{turns}"


def _hard_stop(root: xml.Element, rig: Rig, p: Parameters) -> str:
    stop = beside(root, "hard_stop", "spring")
    stop.set("stiffness", repr(p["stiffness"]))
    stop.set("springlength", f"{-p['angle']!r} {p['angle']!r}")
    return f"tendon of {p['stiffness']:g} N·m/rad with a dead band of {p['angle']:g} rad in springlength"


def _spring_hysteresis(root: xml.Element, rig: Rig, p: Parameters) -> str:
    """Say the major loop: its branch -1 + 2 exp(-u) is twice the first loading 1 - exp(-2 u), half as steep.

    (Masing's rule, which elasto-plastic springs in parallel obey; u: way over `angle`.)
    """
    if p["gamma"]:
        raise others.Unrepresentable(f"springs that yield unload as they load, gamma is {p['gamma']:g}")
    edges = np.concatenate([[0.0], -0.5 * np.log1p(-np.arange(1, ELEMENTS) / ELEMENTS), [2.5]])
    levels = 1.0 - np.exp(-2.0 * edges)
    slopes = np.append(np.diff(levels) / np.diff(edges), 0.0)
    for k, (slope, edge) in enumerate(zip(-np.diff(slopes), edges[1:], strict=True)):
        element = beside(root, f"hysteresis_{k}", "spring")
        element.set("stiffness", repr(float(slope * p["torque"] / p["angle"])))
        element.set("springyield", repr(float(edge * p["angle"])))
    return f"{ELEMENTS} elasto-plastic springs (springyield): its large loops; small ones are too stiff"


def _torque_ripple(root: xml.Element, rig: Rig, p: Parameters) -> str:
    cycles = p["cycles_per_revolution"] * train_ratio(rig)
    cogging = (p["amplitude"] / cycles, 1, p["phase"])
    passive(root, "ripple", gear=repr(cycles), cogging=f"{cogging[0]!r} 1 {cogging[2]!r}")
    return f"dcmotor cogging, {cycles:g} cycles for a turn of the output"


def _backlash(root: xml.Element, rig: Rig, p: Parameters) -> str:
    if math.isfinite(rig["gear.stiffness"]):
        raise others.Unrepresentable("play beside a gear that gives has no place in the model")
    return f"a hinge each for chassis and gear, the tendon between them limited to {p['gap']:g} rad in all"


def _voltage_sag(root: xml.Element, rig: Rig, p: Parameters) -> str:
    first = motor(root)
    if first.tag != "general" or first.get("dyntype"):
        raise others.Unrepresentable("a dcmotor has no room for the rig's loop or lag beside it")
    if float(first.get("gainprm", "1")) != 1.0:
        raise others.Unrepresentable("a dcmotor has no room for a torque constant error beside it")
    first.tag = "dcmotor"
    del first.attrib["gainprm"]
    limit = f"0 0 0 0 0 {p['no_load_speed']!r}"
    resistance = repr(p["no_load_speed"] / p["limit"])
    first.attrib.update(input="ff", motorconst="1", resistance=resistance, controller=limit)
    return f"dcmotor of constant 1, {p['no_load_speed'] / p['limit']:g} Ohm and Vmax {p['no_load_speed']:g} V"


STRUCTURES: Mapping[str, str] = {
    "gear_compliance": "a spring between the mesh's output and the chassis, each with a hinge",
    "base_compliance": "a hinge, stiffness and damping for the end that gives",
    "gravity_error": "mass on the free end",
}
"""Effects that the rig's own bodies say."""
EFFECTS: Mapping[str, Effect] = {
    "command_delay": _command_delay,
    "current_loop_lag": _current_loop_lag,
    "torque_saturation": _torque_saturation,
    "torque_constant_error": _torque_constant_error,
    "coulomb_friction": _coulomb_friction,
    "stribeck_friction": _stribeck_friction,
    "lugre_friction": lambda root, rig, p: _lugre(
        root, "lugre", p["bristle_stiffness"], p, p["bristle_damping"]
    ),
    "asymmetric_friction": _asymmetric_friction,
    "quadratic_drag": _quadratic_drag,
    "nonlinear_spring": lambda root, rig, p: _polynomial(root, rig, 2, p["cubic"], "x^3"),
    "lopsided_spring": lambda root, rig, p: _polynomial(root, rig, 1, p["quadratic"], "x^2"),
    "hard_stop": _hard_stop,
    "spring_hysteresis": _spring_hysteresis,
    "torque_ripple": _torque_ripple,
    "backlash": _backlash,
    "voltage_sag": _voltage_sag,
}


def say_loop(rig: Rig, root: xml.Element) -> tuple[dict[str, str], dict[str, str]]:
    """Turn the motor into the loop's actuator; return exported and omitted parts."""
    if rig.loop is None:
        return {"motor": "motor on the tendon output - housing"}, {}
    k_p, k_d = others.pd_gains(rig)
    named = {"kp": k_p, "ki": rig["controller.k_i"], "kv": k_d}
    gains = {name: value for name, value in named.items() if value}
    first = motor(root)
    first.tag = "pid"
    del first.attrib["gainprm"]
    first.attrib.update({"input": "pos", **{name: repr(value) for name, value in gains.items()}})
    limit = rig["controller.torque_limit"]
    if math.isfinite(limit):
        first.set("forcerange", f"{-limit!r} {limit!r}")
    how = "pid actuator, " + ", ".join(f"{name} {value:g}" for name, value in gains.items())
    left = {}
    if rig.encoder_end == "spring_end":
        over = "an actuator's loop closes over its own tendon, that of the gear output"
        left["encoder at the spring's end"] = over
    terms = {
        "sample_time": "the loop runs at the model's step",
        "velocity_limit": "slewmax limits the target, not what the loop asks",
        "k_f": "the setpoint has no feed-forward of its rate",
        "k_vi": "the integral is of the position's error",
    }
    return {f"{rig.loop} loop": how}, left | others.omitted_terms(rig, terms)


def export_mjcf(rig: Rig) -> others.Export:
    """Return the model of a rig.

    Raises RigError for a rig that MJCF cannot represent (see design/mujoco_model.py).
    """
    others.check_rotary(rig)
    rig = others.without_null_effects(rig)
    finite = others.finite_sizes(rig)
    play = next((float(one.parameters["gap"]) for one in rig.effects if one.name == "backlash"), 0.0)
    root = model_element(with_structure(rig), play)
    says, left = say_loop(rig, root)
    for name in sorted(finite, key=lambda name: effect_named(name).order):
        try:
            if name in STRUCTURES:
                says[name] = STRUCTURES[name]
            elif name in EFFECTS:
                says[name] = EFFECTS[name](root, rig, finite[name])
        except others.Unrepresentable as reason:
            left[name] = str(reason)
    left = others.omitted_effects(rig, says, "MuJoCo has no element for it") | left
    perfect = "sensors of MJCF are those of perfect instruments; the rig's noise and quanta stay with the rig"
    left |= others.omitted_sensors(rig, perfect)
    root.insert(0, others.coverage_comment(says, left))
    return others.Export("mjcf", ".xml", text(root), says, left, play_mujoco)
