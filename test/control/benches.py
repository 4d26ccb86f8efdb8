"""Benches of the controller's tests, gains designed for them, and a loop whose readings may be spoiled."""

import math
from dataclasses import replace

import numpy as np

from rsea_ros.control.following import reading
from rsea_ros.control.law import Gains
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.control.uncertainty import Uncertainty, load_range
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant

RATE, FAST = 280.0, 1000.0
RIG, FREE = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
LOADS = load_range(RIG, FREE)
GAINS_AT = {
    RATE: Gains(0.2575, 0.003029, 1.195, 6.99, 42.9),
    FAST: Gains(0.2446, 0.00087, 0.612, 29.97, 53.6),
}
GAINS = GAINS_AT[RATE]
SET = Uncertainty(delay=2e-3, mode=(33.0, 0.02, 0.3))
DESIGN = ControllerDesign(GAINS, RATE, {}, math.nan)
ROBUST = replace(DESIGN, uncertainty=SET)


def wave(k, amplitude=10.0, hz=5.0, rate=RATE):
    """Return a sine at sample k."""
    return amplitude * math.sin(2.0 * math.pi * hz * k / rate)


def play(rig, count, answer, *, delay=0, rate=RATE, seed=0):
    """Let a bench read and obey; return ft and the torques that were sent, N m.

    answer: turns a sample's number and reading into a torque, which acts `delay` samples after the next one;
    None ends it.
    """
    plant, acting, rows = Plant(rig, rate, seed=seed), [0.0] * (1 + delay), []
    for k in range(count):
        sample = plant.step(acting.pop(0))
        if (torque := answer(k, reading(sample))) is None:
            break
        acting.append(torque)
        rows.append((sample.ft, torque))
    return np.reshape(rows, (-1, 2)).T
