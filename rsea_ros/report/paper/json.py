"""paper.json: every number of the paper beside ours, for programs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.arrangements import arrangements, limits
from rsea_ros.paper.bands import TOLERANCES, Bands
from rsea_ros.paper.claims import TABLE_2, claims
from rsea_ros.paper.findings import findings
from rsea_ros.paper.moving_output import MovingOutput
from rsea_ros.report.json_values import finite
from rsea_ros.report.paper.page import PaperTests, actuator_bands


def paper_json(tests: PaperTests) -> dict[str, Any]:
    """Return the result file. hz: null where a band has no edge."""
    rig = load_rig("paper_moving_output")
    return {
        "schema": 1,
        "claims": [{**asdict(c), "difference": c.difference, "agrees": c.agrees} for c in claims()],
        "findings": [asdict(f) for f in findings()],
        "table_2": {name: {"printed": printed, "unit": unit} for name, (printed, unit) in TABLE_2.items()},
        "bands": {name: _bands(b) for name, b in actuator_bands().items()},
        "arrangements": [asdict(a) for a in arrangements(rig)],
        "limits": [asdict(limit) for limit in limits(rig)],
        "moving_output": {name: _moving_output(test) for name, test in tests.moving.items()},
    }


def _bands(b: Bands) -> dict[str, Any]:
    return {
        "eq_7_hz": b.eq_7,
        "eq_7_with_spin_hz": b.eq_7_spin,
        "eq_7_with_spin_hz_90_percent_of_rotor_inertia": [finite(v) for v in b.spin_range],
        "tolerances_db_deg": [list(t) for t in TOLERANCES],
        "exact": {row.what: [finite(v) for v in row.hz] for row in b.rows},
        "spring_limit": b.spring_limit,
        "motor_limit": [{"hz": f, "torque": t} for f, t in b.motor_limit.items()],
    }


def _moving_output(test: MovingOutput) -> dict[str, Any]:
    return {rival.name: [asdict(j) for j in rival.held_out] for rival in test.rivals}
