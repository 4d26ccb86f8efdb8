"""The comparison with other programs: what is held out, and how a result becomes a row."""

import math

import numpy as np
import pytest

from bench.peers.cases import PeerRecord
from bench.peers.score import Result, record_of, row

Y = np.sin(np.arange(40.0))
CASE = PeerRecord("a case", np.ones(40), Y, 10.0, 30, "joint", 0.5, Y, truth={"inertia": 2.0, "damping": 4.0})


def test_a_record_has_no_measurement_that_is_held_out():
    known, whole = record_of(CASE, 30), record_of(CASE, 40)
    assert np.array_equal(known["position"].y, Y[:30]) and "velocity" not in known
    assert not whole["position"].y.any() and whole["command"].y.all()


def test_a_result_becomes_a_row():
    result = Result(Y[30:] + 1.0, {"inertia": 2.2, "damping": 4.0, "stiffness": 1.0}, "", "explained")
    cells = row(CASE, result, 1.24).measured
    assert float(cells["fit, %"]) == pytest.approx(100.0 * (1.0 - 1.0 / Y[30:].std()), rel=5e-3)
    assert cells["residual / noise"] == "2" and cells["values off, %"] == f"{10.0 / math.sqrt(2.0):.3g}"
    assert (cells["cause"], cells["s"], cells["note"]) == ("none named", "1.2", "explained")
