"""Each law is learnt once."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run

from rsea_ros.laws.law import LawResult
from rsea_ros.laws.learn import learn
from rsea_ros.model.rig_file import load_rig

SECONDS = 6.0


@cache
def learnt(values: tuple[tuple[str, float], ...], seed: int = 3) -> LawResult:
    """Return the law learnt from a record of the second bench with hidden values."""
    bench = drawn_bench(np.random.default_rng(seed)).with_values(**dict(values))
    return learn([record_run(bench, seed, "chirp_noise", SECONDS)], load_rig("paper_high_impedance"))


@pytest.fixture(scope="session")
def learn_of():
    """Return a function that learns from a record with hidden values, once for each."""
    return lambda **values: learnt(tuple(sorted(values.items())))
