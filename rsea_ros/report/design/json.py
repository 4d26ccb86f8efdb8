"""design.json: a design for programs."""

from __future__ import annotations

from typing import Any

from rsea_ros.design.by_train import WithTrain, by_train
from rsea_ros.design.spring_design import SpringDesign, stiffness_bounds
from rsea_ros.design.tolerance import margins
from rsea_ros.report.json_values import finite


def design_json(asked: SpringDesign, least: SpringDesign, robust: SpringDesign | None) -> dict[str, Any]:
    """Return the result file. Angles in rad; null where a design cannot carry the torque."""
    r = asked.requirement
    return {
        "schema": 1,
        "requirement": {name: getattr(r, name) for name in r.__dataclass_fields__},
        "unit": asked.unit.name,
        "train": asked.unit.train,
        "by_train": [_by_train(row) for row in by_train(r, asked.unit, asked.stiffness)],
        "least_stiffness_by_demand": stiffness_bounds(r, asked.unit),
        "asked": _design(asked),
        "least": _design(least),
        "robust": _design(robust) if robust else None,
    }


def _design(d: SpringDesign) -> dict[str, Any]:
    return {
        "stiffness": d.stiffness,
        "spring_rate": d.rate,
        "arm": d.requirement.arm,
        "largest_torque": 0.5 * d.stiffness,
        "deflection": finite(d.deflection),
        "linear_deflection": d.linear,
        "linearity_error_at_limit": d.error,
        "inner_inertia": d.inner,
        "resonance_hz": finite(d.resonance),
        "bandwidth_eq_7_hz": d.band_eq_7,
        "bandwidth_exact_hz": finite(d.band_exact),
        "feasible": d.feasible,
        "checks": [
            {"name": c.name, "value": finite(c.value), "limit": c.limit, "unit": c.unit, "met": c.met}
            for c in d.checks
        ],
        "margins": [
            {
                "name": m.name,
                "percentiles_5_50_95": [finite(v) for v in m.percentiles],
                "limit": finite(m.limit),
                "share": m.share,
            }
            for m in margins(d)
        ],
    }


def _by_train(row: WithTrain) -> dict[str, Any]:
    return {
        "train": row.train,
        "turns": row.turns,
        "inner_inertia": row.inner,
        "bandwidth_exact_hz": finite(row.band),
        "bandwidth_hz_90_percent_of_rotor_inertia": [finite(v) for v in row.band_range],
        "least_stiffness_for_bandwidth": row.for_band,
        "least_stiffness": row.least,
    }
