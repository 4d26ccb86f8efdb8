"""control.json: a study of a controlled actuator, for programs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from rsea_ros.control.large_signal import Reach
from rsea_ros.control.margins import Margins
from rsea_ros.control.study import AtRate, Study
from rsea_ros.control.trials import Compensated, TrialResult
from rsea_ros.report.json_values import finite, numbers


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
                "torque": finite(motor.torque),
                "speed": finite(motor.speed),
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
        "margins": {name: _margins(m) for name, m in at.design.margins.items()},
        "friction_left": at.design.friction_left,
        "set": {
            "cases": at.swept.cases,
            "unstable": at.swept.unstable,
            "sensitivity": at.swept.sensitivity,
            "where": str(at.swept.where),
            "margins": _margins(at.swept.margins),
        },
        "trials": [_trial(t) for t in at.trials],
        "compensation": [_compensation(c) for c in at.compensations],
        "output_impedance": {
            "hz": z.hz.tolist(),
            "controlled": np.abs(z.controlled).tolist(),
            "motor_off": np.abs(z.motor_off).tolist(),
            "spring": np.abs(z.spring).tolist(),
        },
    }


def _margins(margins: Margins) -> dict[str, float | None]:
    return numbers(asdict(margins))


def _trial(t: TrialResult) -> dict[str, Any]:
    return {
        "what": t.what,
        "value": finite(t.value),
        "unit": t.unit,
        "asked": t.asked,
        "worst": finite(t.worst),
        "asked_worst": t.allowed,
        "met": t.met,
    }


def _compensation(c: Compensated) -> dict[str, Any]:
    return {
        "effect": c.effect.name,
        "parameters": dict(c.effect.parameters),
        "sine_hz": c.hz,
        "error_without": c.without,
        "error_with": c.with_model,
        "gain": c.gain,
    }


def _reach(reach: Reach) -> dict[str, Any]:
    return {"torque_hz": finite(reach.torque), "speed_hz": finite(reach.speed)}
