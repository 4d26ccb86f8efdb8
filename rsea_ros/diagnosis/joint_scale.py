"""Sizes that suit a joint: its torques say how large an effect in N m may be, its limits where one begins.

The typical sizes of the catalogue are those of an actuator of some 20 N m; a servo of 1 N m would stick fast.
"""

from __future__ import annotations

import numpy as np

from rsea_ros.effects.effect import Effect
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive
from rsea_ros.model.position_loop import loop_parameters
from rsea_ros.model.rig import Rig

SHARES = (0.03, 0.1, 0.3)
"""Of a joint's largest torque: what friction, ripple and their like may have."""
_LIMITS = (1.0, 0.9, 0.7)
_LARGEST = 0.999
"""Quantile that is taken for the largest value: a few samples may be outliers."""


def torque_scale(case: Case, rig: Rig) -> float:
    """Return the largest torque of a position loop's motor, N m: measured, or asked for by its errors."""
    if "motor_torque" in case.measured:
        keep = case.mask["motor_torque"]
        return float(np.quantile(np.abs(case.measured["motor_torque"][keep]), _LARGEST))
    if "position" not in case.measured or not isinstance(case.drive, Drive):
        return 0.0
    keep, drive = case.mask["position"], case.drive
    steps = ((case.t["position"][keep] - drive.start) / drive.step).astype(np.int64)
    error = drive.command[np.clip(steps, 0, len(drive.command) - 1)] - case.measured["position"][keep]
    _, position, _, velocity, *_ = loop_parameters(rig)
    gain = position if rig.loop == "pd" else position * velocity
    return gain * float(np.quantile(np.abs(error), _LARGEST))


def joint_starts(effect: Effect, scale: float) -> list[dict[str, float]]:
    """Return where fits of an effect begin whose main parameter is a torque. scale: largest torque, N m."""
    main = effect.main
    shares = _LIMITS if main.name == "limit" else SHARES
    sizes = {min(max(share * scale, main.low), main.high) for share in shares}
    torques = [p.name for p in effect.parameters if p.unit == "N m"]
    return [
        {**effect.typical, **{name: size * effect.typical[name] / main.typical for name in torques}}
        for size in sorted(sizes)
    ]
