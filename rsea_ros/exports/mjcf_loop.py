"""The position loop of a rig as MuJoCo's `pid` actuator."""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree as xml

from rsea_ros.exports.mjcf_effects import motor
from rsea_ros.exports.represented import Omitted, Represented
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
