"""The second bench stands in for a real one; its slow work, and the first run that is designed after it."""

import numpy as np
import pytest
from independent.bench import record_command
from slow_work import ASKED, BENCH, CAUSES, RIG

from rsea_ros.experiment.joint_weighing import weigh
from rsea_ros.experiment.run_design import propose


@pytest.fixture(scope="session")
def log():
    """Return a few seconds of slow work, which show no cause."""
    t = np.arange(4 * 280) / 280.0
    return record_command(BENCH, 0.3 * np.sin(2.0 * np.pi * 0.25 * t), np.random.default_rng(1))


@pytest.fixture(scope="session")
def known(log):
    """Return the evidence of the slow work."""
    return weigh([log], RIG, CAUSES)


@pytest.fixture(scope="session")
def proposal(known):
    """Return the first designed run."""
    return propose(known.hypotheses(), ASKED, known.cases[0].noise)
