"""The comparison with peers: what a peer's script gets to see, and how its result becomes a row."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.peers import score as peers
from bench.peers.cases import PeerRecord

HERE = Path(peers.__file__).parent


@pytest.fixture(scope="module")
def case():
    y = np.sin(np.arange(40.0))
    truth = {"inertia": 2.0, "damping": 4.0}
    return PeerRecord(
        "a case", np.ones(40), y, 10.0, 30, "joint", {"inertia": 1.0}, 0.5, y, np.zeros(0), truth
    )


def test_a_peer_gets_no_measurement_that_is_held_out(case):
    arrays = case.arrays
    for name in ("y", "position"):
        assert np.isnan(arrays[name][30:]).all() and np.isfinite(arrays[name][:30]).all()
    assert np.isfinite(case.y).all() and arrays["velocity"].size == 0
    assert "truth" not in str(case.meta) and "cause" not in case.meta


def test_a_result_becomes_a_row(case):
    parameters = {"inertia": 2.2, "damping": 4.0}
    result = {
        "prediction": list(case.y[30:] + 1.0), "parameters": parameters, "cause": "", "note": "a|b",
        "seconds": 1.24,
    }  # fmt: skip
    _, cells = peers._row("gp", case, result).cells()
    fit = 100.0 * (1.0 - 1.0 / case.y[30:].std())
    off = f"{10.0 / math.sqrt(2.0):.3g}"
    assert cells == ("a case", "gp", "2", f"{fit:.3g}", off, "none named", "1.2", "a/b")


def test_a_peer_that_did_not_run_is_a_row_with_the_reason(case):
    assert "not run: no / wheel" in peers._row("gp", case, {"not_run": "no | wheel"}).cells()[1]


def test_every_peer_has_a_script_and_pinned_requirements():
    scripts = {peer: (HERE / f"{module}.py").read_text() for peer, module in peers.PEERS.items()}
    assert [peer for peer, script in scripts.items() if f"\ndef {peer}(" not in script] == []
    assert all("==" in pin for pins in peers.PINS.values() for pin in pins.split())
