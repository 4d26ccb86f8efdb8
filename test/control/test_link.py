"""The link's measured motion fed forward: softer from outside, as predicted, and no less stable."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bench.control.human import Virtual, measure_impedance
from rsea_ros.control.controller import ControllerSettings, TorqueController
from rsea_ros.control.following import closed_loop
from rsea_ros.control.law import Gains, law_of
from rsea_ros.control.link import LinkMotion, LinkShare, link_share
from rsea_ros.control.margins import distal_responses, link_response
from rsea_ros.control.study import disturbed_rig, lagging_corners
from rsea_ros.control.synthesis import ControllerDesign, DesignLimits
from rsea_ros.control.uncertainty import Uncertainty, load_range
from rsea_ros.model.rig_file import load_rig

RATE = 280.0
RIG, FREE = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
GAINS = Gains(0.2575, 0.003029, 1.195, 6.99, 42.9)
SET = Uncertainty(delay=2e-3, mode=(33.0, 0.02, 0.3))
DESIGN = ControllerDesign(GAINS, RATE, {}, math.nan, uncertainty=SET)
LAW, SHARE = law_of(RIG, RATE, GAINS), LinkShare(0.25, 0.4, 20.0)
HZ = np.array([1.0, 5.0, 20.0])


def test_parts_are_chosen_that_every_bench_of_the_set_stands():
    chosen = link_share(RIG, load_range(RIG, FREE), DESIGN, DesignLimits(impedance=1.2))
    assert chosen == SHARE


def test_the_output_is_as_soft_as_predicted_and_softer_than_without():
    still = distal_responses(RIG, RATE, HZ)
    on_link = link_response(LAW, SHARE.inertia, SHARE.damping, SHARE.corner, HZ)
    felt = np.abs(measure_impedance(RIG, DESIGN, Virtual(0.0, 0.0), HZ, SHARE) / still.spring)
    assert felt == pytest.approx(still.ratio(LAW, on_link), rel=0.04)
    assert np.all(felt[:2] < 0.87 * still.ratio(LAW)[:2])


def test_a_free_load_is_followed_no_worse():
    t = np.arange(840) / RATE
    wanted = 4.2 * np.minimum(1.0, 4.0 * t) ** 2 * np.sin(2.0 * np.pi * 5.0 * t)
    without, with_link = (
        closed_loop(FREE, RATE, TorqueController(RIG, RATE, GAINS, link=share), wanted).error(2.0)
        for share in (None, SHARE)
    )
    assert with_link < min(0.02, without)


@pytest.mark.parametrize("load", ["free x 0.5", "free x 1", "free x 10"])
def test_a_free_load_with_little_drag_and_all_of_the_lag_comes_to_rest(load):
    """In full, inertia and drag are gone for the load and the lag swings a pendulum up."""
    loads = load_range(RIG, FREE)
    little_drag = replace(lagging_corners(load, SET)[0], damping=1.0 - SET.damping)
    true = disturbed_rig(loads, little_drag)
    wanted = np.where(np.arange(1120) < 60, 2.0, 0.0)
    controller = TorqueController(RIG, RATE, GAINS, link=SHARE, settings=ControllerSettings(learn=False))
    ft = closed_loop(true, RATE, controller, wanted, noise=False, late=1).ft
    assert np.std(ft[-280:]) < 0.05 * np.std(ft[60:340])


def test_an_encoder_that_fails_takes_the_torque_away_without_a_jump():
    motion, angle = LinkMotion(LAW, SHARE), lambda k: 0.01 * math.sin(2.0 * math.pi * 3.0 * k / RATE)
    motion.start(0.0)
    before = [motion.torque(angle(k), 0.0) for k in range(1, 200)]
    lost = [motion.torque(math.nan, 0.0) for _ in range(100)]
    assert max(map(abs, np.diff([before[-1], *lost]))) < 0.5 * abs(before[-1]) and abs(lost[-1]) < 1e-6
    again = [motion.torque(angle(k), 0.0) for k in range(300, 500)]
    assert max(map(abs, again)) < 1.5 * max(map(abs, before))
    assert all(LinkMotion(LAW, LinkShare()).torque(angle(k), 0.0) == 0.0 for k in range(10))
