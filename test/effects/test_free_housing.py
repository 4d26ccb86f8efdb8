"""Play with a free housing, where the chassis is a twentieth of the moving inertia, against its events.

A sensor sees b_s times the speed of the chassis, which jumps at an impact: a sample that falls on one may lie
on either side of the jump, and is not compared.
"""

import hybrid_play
import numpy as np
import pytest

from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

RATE, NEAR = 280.0, 1e-4
RIG = load_rig("paper_moving_output")
T = np.arange(280) / RATE
COMMANDS = {
    "noise": 30.0 * np.random.default_rng(3).standard_normal(len(T)),
    "chirp": 30.0 * np.sin(2.0 * np.pi * (0.5 + 9.75 * T) * T),
}


@pytest.mark.parametrize("gap", [1e-3, 4e-3])
@pytest.mark.parametrize("name", COMMANDS)
def test_torque_and_position_are_those_of_the_event_driven_model(name, gap):
    """Asked: 1 % RMS. With impacts that owe the next step nothing it was 5 % and more at 4 mrad."""
    command = COMMANDS[name]
    expected, impacts = hybrid_play.response(command, 1.0 / RATE, gap)
    worn = RIG.with_effects(EffectSetting("backlash", {"gap": gap}))
    record = synthesize(worn, Channel(T, command), noise=False)
    far = np.abs(record["ft"].t[:, None] - impacts).min(axis=1) > NEAR
    assert len(impacts) > 10 and np.count_nonzero(~far) < 5
    for channel, of in (("position", expected[:, 0]), ("ft", expected[:, 1])):
        assert np.std((record[channel].y - of)[far]) < 0.01 * np.std(of)


def test_the_event_driven_model_is_the_benchs():
    values = ("rotor.reflected_inertia", "chassis.inertia", "rotor.reflected_damping", "spring.stiffness",
              "spring.damping", "gear.ratio", "housing_end.inertia", "housing_end.damping",
              "housing_end.stiffness")  # fmt: skip
    names = ("J_M", "J_SC", "B_M", "K_S", "B_S", "RATIO", "J_H", "B_H", "K_H")
    assert [RIG[value] for value in values] == [getattr(hybrid_play, name) for name in names]
