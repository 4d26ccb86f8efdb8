"""Short pieces of a record: a model that is right leaves nothing but noise in any of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.diagnosis.candidate import with_doubled_step
from rsea_ros.diagnosis.short_pieces import short_pieces_of
from rsea_ros.identification.excitation import Settings, excitation
from rsea_ros.identification.identify import CHANNELS
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.signals import Channel

RATE = 280.0


@pytest.mark.parametrize("kind", ["multisine", "white_noise", "chirp"])
def test_the_right_model_leaves_only_noise_in_every_piece(kind):
    """A piece begins at the state that was measured, and what it runs up with does not count."""
    rig = load_rig("paper_high_impedance")
    command = excitation(kind, Settings(rate=RATE, duration=60.0, seed=3, amplitude=40.0))
    record = synthesize(rig, Channel(np.arange(len(command)) / RATE, command), seed=3)
    case = case_from(record, rig)
    problem = Problem((case,), rig, (), CHANNELS)
    pieces = short_pieces_of(case, problem.outputs(np.zeros(0))[0])
    assert len(pieces) > 5
    for piece in pieces:
        (out,) = Problem((piece,), rig, (), CHANNELS).outputs(np.zeros(0))
        for name, values in out.items():
            mask = piece.mask[name]
            left = (piece.measured[name] - values)[mask] / piece.noise[name]
            assert mask.sum() > 100
            assert np.abs(left).max() < 6.0, (piece.start, name)


@pytest.mark.parametrize("jitter", [0.0, 0.1], ids=["on_the_grid", "jittered"])
@pytest.mark.parametrize("rate", [250.0, 280.0, 500.0, 1000.0])
def test_the_true_model_costs_one_for_each_sample_of_its_pieces_on_longer_steps_too(rate, jitter):
    """Pieces that began within a hold gave the motor torque a whole command change: 2.5e7 for 2.5e4."""
    rig = load_rig("paper_high_impedance")
    command = excitation("white_noise", Settings(rate=rate, duration=32.0, seed=5))
    stamps = np.arange(len(command)) / rate
    stamps += jitter / rate * np.random.default_rng(5).uniform(-0.5, 0.5, len(stamps))
    record = synthesize(rig, Channel(stamps, command), seed=5)
    case = case_from(record, rig)
    sensors = {n: rig.sensors[n] for n in case.noise}
    noise = {n: math.hypot(s.noise, s.quantum / math.sqrt(12.0)) for n, s in sensors.items()}
    case = replace(case, noise=noise)
    pieces = short_pieces_of(case, Problem((case,), rig, (), CHANNELS).outputs(np.zeros(0))[0])
    assert len(pieces) > 5
    for problem in (
        Problem(pieces, rig, (), CHANNELS),
        with_doubled_step(Problem(pieces, rig, (), CHANNELS)),
    ):
        residual = problem.residual(np.zeros(0))
        assert float(residual @ residual) == pytest.approx(len(residual), rel=0.1)
