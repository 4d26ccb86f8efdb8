"""A rig's friction as parameters of BAM, the servo models M1 to M6, in the JSON that its `load_model` reads.

    loss = base + stribeck exp(-|w / dtheta_stribeck|^alpha) + load parts,   damping = viscous

M1 Coulomb and viscous, M2 with Stribeck, M3 with load, M4 with both, M5 load by direction, M6 quadratic.
BAM's external torque is minus that in the spring; M3 and M4 take |external - motor|, which at slow speed
is twice the load, so their coefficients are half of ours. Source: Duclusaud, Passault, Padois, Ly, Extended
friction models for the physics simulation of servo actuators, 2024; the parameters' names: bam/model.py.
"""

import json
from collections.abc import Mapping

from rsea_ros import Rig
from rsea_ros.extension.target import gear_inertia, others

ALPHA = 2.0
"""Of the Stribeck curve of our effects."""
ANY_SPEED = 1e9
"""rad/s, as Stribeck velocity: M6 fades its quadratic part with speed, ours does not."""


def export_bam(rig: Rig, actuator: str = "") -> others.Export:
    """Return the parameters of a rig. actuator: BAM's name of the servo, which brings its control law."""
    rig = others.without_null_effects(rig)
    effects = others.finite_sizes(rig)
    says = {"rotor.reflected_inertia": "armature", "rotor.reflected_damping": "friction_viscous"}
    values: dict[str, object] = {
        "armature": gear_inertia(rig),
        "q_offset": 0.0,
        "friction_viscous": rig["rotor.reflected_damping"],
    }
    values |= _dry(effects, says) | _load(effects, says)
    model = _model(effects)
    values |= {"model": model, "actuator": actuator}
    left = {"kt, R": "the rig has no voltage; from the data sheet, or from bam.fit"}
    if not actuator:
        left["actuator"] = "BAM's name of the servo, with its control law (--actuator)"
    left |= others.omitted_parts(rig, "a BAM joint is rigid")
    left |= others.omitted_effects(rig, says, f"no parameter of {model.upper()}")
    values["rsea"] = {"rig": rig.name, "says": says, "leaves_out": left}
    return others.Export("bam", ".json", json.dumps(values, indent=2) + "\n", says, left)


def _model(effects: Mapping[str, Mapping[str, float]]) -> str:
    """Return the smallest model that says the rig's friction."""
    by_direction = effects.get("directional_load_friction")
    if by_direction is not None:
        return "m6" if by_direction.get("quadratic", 0.0) else "m5"
    has_stribeck = bool(effects.keys() & {"stribeck_friction", "lugre_friction"})
    if "load_dependent_friction" in effects:
        return "m4" if has_stribeck else "m3"
    return "m2" if has_stribeck else "m1"


def _dry(effects: Mapping[str, Mapping[str, float]], says: dict[str, str]) -> dict[str, float]:
    """Return the parameters that do not depend on the load."""
    curve = "friction_base, friction_stribeck, dtheta_stribeck, alpha 2"
    words = {"coulomb_friction": "friction_base", "stribeck_friction": curve}
    words["lugre_friction"] = f"{curve}, its bristles left out"
    says |= {name: how for name, how in words.items() if name in effects}
    base, stribeck, speed = others.dry_friction(effects)
    if _model(effects) in ("m1", "m3"):
        return {"friction_base": base}
    return {"friction_base": base, "friction_stribeck": stribeck, "dtheta_stribeck": speed, "alpha": ALPHA}


def _load(effects: Mapping[str, Mapping[str, float]], says: dict[str, str]) -> dict[str, float]:
    """Return the parameters that depend on the load."""
    model, name = _model(effects), "directional_load_friction"
    if model in ("m3", "m4"):
        says["load_dependent_friction"] = "load_friction_base, half of the coefficient"
        half = 0.5 * effects["load_dependent_friction"]["coefficient"]
        return {"load_friction_base": half, **({"load_friction_stribeck": 0.0} if model == "m4" else {})}
    if model not in ("m5", "m6"):
        return {}
    p = effects[name]
    says[name] = f"load_friction_motor, load_friction_external{', and their quad' if model == 'm6' else ''}"
    sides = {"motor": p["motor_coefficient"], "external": p["load_coefficient"]}
    values = {f"load_friction_{side}": size for side, size in sides.items()}
    values |= {f"load_friction_{side}_stribeck": 0.0 for side in sides}
    if model == "m6":
        values |= {f"load_friction_{side}_quad": p["quadratic"] for side in sides}
        if not effects.keys() & {"stribeck_friction", "lugre_friction"}:
            values["dtheta_stribeck"] = ANY_SPEED
    return values
