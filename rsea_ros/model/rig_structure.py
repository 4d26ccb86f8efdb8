"""Consistency of the parts of a rig: its ends, its trains, its spring, its loop."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rsea_ros.errors import RigError
from rsea_ros.model.rig_fields import END_NAMES, LOOP_FIELDS, LOOP_LIMITS
from rsea_ros.model.train import TRAINS

if TYPE_CHECKING:
    from rsea_ros.model.rig import Rig


def check_structure(rig: Rig) -> None:
    """Raise RigError where parts of a rig contradict each other, or one is missing."""
    _check_clamped(rig)
    _check_trains(rig)
    _check_sensor_end(rig)
    _check_spring(rig)
    for name in ("rotor.reflected_inertia", "rotor.reflected_damping"):
        rig[name]
    _check_encoder_end(rig)
    _check_loop(rig)
    for end in END_NAMES:
        if rig.end_is_free(end):
            rig[f"{end}.inertia"]


def check_two_torques(rig: Rig) -> None:
    """Raise RigError for a rig without a spring: it has one torque, not one on either side."""
    if rig.rigid_spring:
        raise RigError(f"rig {rig.name}: spring.rigid = True, expected a spring with a torque on either side")


def _check_clamped(rig: Rig) -> None:
    for end in set(rig.clamped) - set(END_NAMES):
        raise RigError(f"rig {rig.name}: clamped end {end!r}, expected one of {', '.join(END_NAMES)}")


def _check_trains(rig: Rig) -> None:
    expected = f"expected one of {', '.join(TRAINS)}"
    if rig.train not in TRAINS:
        raise RigError(f"rig {rig.name}: gear.train = {rig.train!r}, {expected}", "gear.train")
    for train in rig.other_trains:
        if train not in TRAINS:
            raise RigError(f"rig {rig.name}: gear.or has {train!r}, {expected}", "gear.or")


def _check_sensor_end(rig: Rig) -> None:
    for key, end in (("proximal", rig.proximal), ("ft_end", rig.ft_end)):
        if end not in END_NAMES:
            raise RigError(f"rig {rig.name}: {key} = {end!r}, expected one of {', '.join(END_NAMES)}", key)
    if rig.ft_end == "housing_end" and math.isinf(rig["proximal_spring.stiffness"]):
        raise RigError(
            f"rig {rig.name}: ft_end = housing_end without proximal_spring.stiffness, expected that of the "
            "sensor, N·m/rad"
        )


def _check_spring(rig: Rig) -> None:
    if rig.rigid_spring and "spring_end" in rig.clamped and math.isinf(rig["gear.stiffness"]):
        raise RigError(
            f"rig {rig.name}: spring rigid and spring_end clamped, expected one of them: nothing could move"
        )
    if not rig.rigid_spring and math.isinf(rig["spring.stiffness"]):
        value = "= inf" if "spring.stiffness" in rig.quantities else "is missing"
        raise RigError(
            f"rig {rig.name}: spring.stiffness {value}, expected a value in N·m/rad or `rigid: true`",
            "spring.stiffness",
        )


def _check_encoder_end(rig: Rig) -> None:
    if rig.encoder_end not in ("gear_output", "spring_end"):
        raise RigError(
            f"rig {rig.name}: encoder_end = {rig.encoder_end!r}, expected gear_output or spring_end",
            "encoder_end",
        )


def _check_loop(rig: Rig) -> None:
    stated = [n.split(".")[1] for n in rig.quantities if n.startswith("controller.")]
    if rig.loop is None:
        if stated:
            raise RigError(
                f"rig {rig.name}: controller.{stated[0]} without controller.kind, expected one of "
                f"{', '.join(LOOP_FIELDS)}",
                "controller",
            )
        return
    if rig.loop not in LOOP_FIELDS:
        raise RigError(
            f"rig {rig.name}: controller.kind = {rig.loop!r}, expected one of {', '.join(LOOP_FIELDS)}",
            "controller.kind",
        )
    allowed = (*LOOP_FIELDS[rig.loop], *LOOP_LIMITS)
    for name in stated:
        if name not in allowed:
            raise RigError(
                f"rig {rig.name}: controller.{name} in a {rig.loop} loop, expected {', '.join(allowed)}",
                f"controller.{name}",
            )
    for name in LOOP_FIELDS[rig.loop]:
        rig[f"controller.{name}"]
