"""Shared by the tests of the command line: a short record, and a place that must stay empty."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record


@pytest.fixture(scope="module")
def record() -> Record:
    u = excitation("white_noise", ExcitationSettings(duration=4.0))
    return synthesize(load_rig("paper_high_impedance"), Channel(np.arange(len(u)) / 280.0, u))


@pytest.fixture
def out(tmp_path: Path) -> Iterator[Path]:
    """Yield a directory for results that must be empty after the test."""
    yield tmp_path / "results"
    left = list((tmp_path / "results").glob("*"))
    assert not left, left
