"""The tables of a fleet, and the page of a joint that has few days."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parent))  # for `worn_fleet`
sys.path.append(str(Path(__file__).resolve().parents[1] / "trends"))  # for `fleet_histories`

from fleet_histories import cause, history, recordings
from worn_fleet import JOINTS, WORN

from rsea_extras.pages.page import write_fleet_report
from test.report.conftest import browser  # noqa: F401  a fixture


@pytest.fixture(scope="session")
def tables():
    """A joint that wears, one with backlash from day 50 on, one that cannot be determined."""
    rng = np.random.default_rng(3)
    made = history(
        rng, joints=JOINTS, days=100, course=lambda j, d: -2e-3 * np.clip(d - 40, 0, None) * (j == WORN)
    )
    made["identifiable"] &= made["joint"] != "elbow"
    names = recordings(
        JOINTS, 100, causes=lambda j, d: [cause("backlash", 2e-3)] if j == "hip" and d >= 50 else [],
        faults=lambda j, d: [{"kind": "outliers", "count": 3, "detail": ""}] if d == 7 else [],
    )  # fmt: skip
    return made, names


@pytest.fixture(scope="session")
def young(tmp_path_factory):
    """The page of a joint with two parameters and three days."""
    parts = [
        history(np.random.default_rng(1), joints=("hip",), days=3, parameter=parameter)
        for parameter in ("spring.stiffness", "rotor.reflected_damping")
    ]
    made = {n: np.concatenate([p[n] for p in parts]) for n in parts[0]}
    worn = recordings(("hip",), 3, causes=lambda j, d: [cause("backlash", 4e-3)])
    index = write_fleet_report(made, worn, tmp_path_factory.mktemp("young") / "out")
    return index.parent / "joint-hip.html"
