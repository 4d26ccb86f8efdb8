"""Short pieces of a record: a model that is right leaves nothing but noise in any of them."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.diagnosis.windows import windows_of
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
    pieces = windows_of(case, problem.outputs(np.zeros(0))[0])
    assert len(pieces) > 5
    for piece in pieces:
        (out,) = Problem((piece,), rig, (), CHANNELS).outputs(np.zeros(0))
        for name, values in out.items():
            mask = piece.mask[name]
            left = (piece.measured[name] - values)[mask] / piece.noise[name]
            assert mask.sum() > 100
            assert np.abs(left).max() < 6.0, (piece.start, name)
