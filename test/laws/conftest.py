"""Each law is learnt once."""

from functools import cache

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from runs import RIG

from rsea_ros.laws.learn import learn


@pytest.fixture(scope="session")
def learn_of():
    """Return a function that learns from a record of the second bench with hidden values, once for each."""

    @cache
    def learnt(**values):
        bench = drawn_bench(np.random.default_rng(3)).with_values(**values)
        return learn([record_run(bench, 3, "chirp_noise", 4.0)], RIG)

    return learnt
