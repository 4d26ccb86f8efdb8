"""Faults in the data of a run are published on /diagnostics beside its results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.nodes import identify as node
from rsea_ros.nodes._health import OK, WARN
from rsea_ros.records.record import Fault

FROZEN = Fault("frozen_samples", "ft", 0.3)


@pytest.fixture(scope="module")
def run():
    return rsea.simulate(
        "paper_high_impedance", 15.0 * np.random.default_rng(4).standard_normal(2000), 280.0, seed=4
    )


def test_faults_in_the_data_of_an_identification_are_published(run):
    result = rsea.identify(run, "paper_high_impedance").result
    sound, damaged = (
        node.report_of(r, Path("report.html")) for r in (result, replace(result, faults=(FROZEN,)))
    )
    assert (sound.level, sound.values["verdict"], sound.values["faults"]) == (OK, "adequate", "")
    assert damaged.level == WARN
    assert damaged.values["faults"] == "frozen samples in F/T torque, 30 % of the samples"
    assert damaged.summary.startswith("The model fits: ")
