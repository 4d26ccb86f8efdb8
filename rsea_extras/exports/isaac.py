"""A rig as an actuator of Isaac Lab: `DelayedPDActuatorCfg` with armature and friction, in a Python file.

Source: Isaac Lab 2.3, isaaclab.actuators (ActuatorBaseCfg, DelayedPDActuatorCfg, DCMotorCfg); friction is
static friction in N m, dynamic_friction and viscous_friction need Isaac Sim 5.
"""

import math
from collections.abc import Mapping

from rsea_ros import Rig
from rsea_ros.extension.base import in_docstring
from rsea_ros.extension.target import gear_inertia, others

PHYSICS_STEP = 0.005
"""s, of Isaac Lab's examples; a line of the file that its user changes."""


def export_isaac(rig: Rig) -> others.Export:
    """Return the configuration of a rig's actuator."""
    rig = others.without_null_effects(rig)
    effects = others.finite_sizes(rig)
    says = {"rotor.reflected_inertia": "armature", "rotor.reflected_damping": "viscous_friction"}
    joint = {"armature": gear_inertia(rig), "viscous_friction": rig["rotor.reflected_damping"]}
    delay = effects.get("command_delay", {}).get("delay", 0.0)
    fields = joint | _loop(rig, says) | _friction(effects, says) | _limits(rig, effects, says)
    kind = "DelayedPDActuatorCfg"
    if "voltage_sag" in effects and not delay:
        kind = "DCMotorCfg"
        sag = effects["voltage_sag"]
        fields |= {"saturation_effort": sag["limit"], "velocity_limit": sag["no_load_speed"]}
        says["voltage_sag"] = "DCMotorCfg, saturation_effort and velocity_limit"
    elif delay:
        says["command_delay"] = "min_delay = max_delay, in steps of the physics"
    left = others.omitted_parts(rig, "an actuator drives one rigid joint; give it a passive joint beyond")
    left |= others.omitted_effects(rig, says, f"{kind} has no field for it")
    terms = ("k_i", "k_f", "k_vi", "sample_time", "velocity_limit")
    left |= others.omitted_terms(rig, dict.fromkeys(terms, "the PD law has no place for it"))
    lines = [f'"""Actuator of {in_docstring(rig.name)}, written by rsea export --isaac.', ""]
    lines += [in_docstring(line) for line in others.coverage_lines(says, left)]
    lines += ['"""', "", f"from isaaclab.actuators import {kind}", ""]
    if kind == "DelayedPDActuatorCfg":
        step = f"PHYSICS_STEP = {PHYSICS_STEP!r}  # s, of your SimulationCfg"
        lines += [step, f"DELAY = {delay!r}  # s", ""]
    lines += [f"ACTUATOR = {kind}(", '    joint_names_expr=[".*"],  # the joints of this kind']
    lines += [f"    {name}={value!r}," for name, value in fields.items()]
    if kind == "DelayedPDActuatorCfg":
        lines += [f"    {end}_delay=round(DELAY / PHYSICS_STEP)," for end in ("min", "max")]
    return others.Export("isaac", ".py", "\n".join([*lines, ")", ""]), says, left)


def _loop(rig: Rig, says: dict[str, str]) -> dict[str, float]:
    """Return the gains; a rig that torques command has none, and takes efforts."""
    if rig.loop is None:
        says["torque command"] = "stiffness and damping 0: set joint efforts"
        return {"stiffness": 0.0, "damping": 0.0}
    says[f"{rig.loop} loop"] = "stiffness and damping"
    return dict(zip(("stiffness", "damping"), others.pd_gains(rig), strict=True))


def _friction(effects: Mapping[str, Mapping[str, float]], says: dict[str, str]) -> dict[str, float]:
    at_rest = "friction at rest, dynamic_friction at speed; not the curve between"
    words = {"coulomb_friction": "friction and dynamic_friction"}
    words |= dict.fromkeys(("stribeck_friction", "lugre_friction"), at_rest)
    says |= {name: how for name, how in words.items() if name in effects}
    dynamic, stribeck, _ = others.dry_friction(effects)
    return {"friction": dynamic + stribeck, "dynamic_friction": dynamic}


def _limits(rig: Rig, effects: Mapping[str, Mapping[str, float]], says: dict[str, str]) -> dict[str, float]:
    if "torque_saturation" in effects:
        says["torque_saturation"] = "effort_limit"
    limit = min(others.command_limit(rig), effects.get("torque_saturation", {}).get("limit", math.inf))
    return {"effort_limit": limit} if math.isfinite(limit) else {}
