"""Shared by the tests of the command line: a short record, and what a verb refuses."""

from collections.abc import Callable

import numpy as np
import pytest

from rsea_ros.cli.main import main
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record


@pytest.fixture(scope="module")
def record() -> Record:
    u = excitation("white_noise", ExcitationSettings(duration=4.0))
    return synthesize(load_rig("paper_high_impedance"), Channel(np.arange(len(u)) / 280.0, u))


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Return a function that plays a verb and returns the one line with which it refuses, status 2."""

    def play(*words: object) -> str:
        capsys.readouterr()
        try:
            status = main([str(word) for word in words])
        except SystemExit as leaving:
            status = leaving.code
        printed, line = capsys.readouterr()
        assert (status, printed, line.count("\n")) == (2, "", 1), line
        return line

    return play
