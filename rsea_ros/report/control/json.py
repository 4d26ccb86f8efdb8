"""control.json: a study of a controlled actuator, for programs."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from rsea_ros.control.large_signal import Reach
from rsea_ros.control.study import AtRate, Study


def control_json(study: Study) -> dict[str, Any]:
    """Return the result file. SI; null where a number is infinite."""
    return {
        "schema": 1,
        "rig": study.rig.name,
        "open_loop_resonance_hz": study.resonance,
        "rates": [_at_rate(at) for at in study.rates],
        "large_signal": [
            {
                "motor": motor.name,
                "torque": _finite(motor.torque),
                "speed": _finite(motor.speed),
                "source": motor.source,
                "limits": [
                    {
                        "amplitude": locked.amplitude,
                        "locked": _reach(locked),
                        "free": _reach(free),
                    }
                    for locked, free in rows
                ],
            }
            for motor, rows in study.reaches.items()
        ],
    }


def _at_rate(at: AtRate) -> dict[str, Any]:
    z = at.impedance
    return {
        "rate_hz": at.design.rate,
        "gains": asdict(at.design.gains),
        "margins": {n: {k: _finite(v) for k, v in asdict(m).items()} for n, m in at.design.margins.items()},
        "friction_left": at.design.friction_left,
        "set": {
            "cases": at.swept.cases,
            "unstable": at.swept.unstable,
            "sensitivity": at.swept.sensitivity,
            "where": str(at.swept.where),
            "margins": {k: _finite(v) for k, v in asdict(at.swept.margins).items()},
        },
        "trials": [
            {
                "what": t.what,
                "value": _finite(t.value),
                "unit": t.unit,
                "asked": t.asked,
                "worst": _finite(t.worst),
                "asked_worst": t.allowed,
                "met": t.met,
            }
            for t in at.trials
        ],
        "compensation": [
            {
                "effect": c.effect.name,
                "parameters": dict(c.effect.parameters),
                "sine_hz": c.hz,
                "error_without": c.without,
                "error_with": c.with_model,
                "gain": c.gain,
            }
            for c in at.compensations
        ],
        "output_impedance": {
            "hz": z.hz.tolist(),
            "controlled": np.abs(z.controlled).tolist(),
            "motor_off": np.abs(z.motor_off).tolist(),
            "spring": np.abs(z.spring).tolist(),
        },
    }


def _reach(reach: Reach) -> dict[str, Any]:
    return {"torque_hz": _finite(reach.torque), "speed_hz": _finite(reach.speed)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
