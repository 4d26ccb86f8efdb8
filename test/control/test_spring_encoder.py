"""The encoder on the spring counts while it agrees with ft; the link's motion fed forward is softer."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from bench.control.human import Virtual, measure_impedance
from rsea_ros.control.controller import ControllerSettings, Measurement, TorqueController
from rsea_ros.control.following import closed_loop
from rsea_ros.control.law import law_of
from rsea_ros.control.link import LinkMotion, LinkShare, SpringEncoder, SpringReading, link_share
from rsea_ros.control.margins import distal_responses, link_response
from rsea_ros.control.study import disturbed_rig, lagging_corners
from rsea_ros.control.synthesis import DesignLimits
from rsea_ros.model.rig import Sensor
from rsea_ros.model.simulation import Plant
from test.control.benches import FREE, GAINS, LOADS, RATE, RIG, ROBUST, SET, wave

LAW, SHARE = law_of(RIG, RATE, GAINS), LinkShare(0.25, 0.4, 20.0)
ENCODED, ENCODED_FREE = (
    replace(rig, sensors={**rig.sensors, "deflection": Sensor(noise=5e-6)}) for rig in (RIG, FREE)
)


def controller(**options):
    return TorqueController(RIG, RATE, GAINS, **options)


def grown_sine(seconds, rise):
    """Return a sine of 5 Hz that grows for `rise` s, N m."""
    t = np.arange(round(seconds * RATE)) / RATE
    return 4.2 * np.minimum(1.0, t / rise) ** 2 * np.sin(2.0 * np.pi * 5.0 * t)


def test_parts_are_chosen_that_every_bench_of_the_set_stands():
    assert link_share(RIG, LOADS, ROBUST, DesignLimits(impedance=1.2)) == SHARE


def test_the_output_is_as_soft_as_predicted_and_softer_than_without():
    hz = np.array([1.0, 5.0, 20.0])
    still = distal_responses(RIG, RATE, hz)
    on_link = link_response(LAW, SHARE.inertia, SHARE.damping, SHARE.corner, hz)
    felt = np.abs(measure_impedance(RIG, ROBUST, Virtual(0.0, 0.0), hz, SHARE) / still.spring)
    assert felt == pytest.approx(still.ratio(LAW, on_link), rel=0.04)
    assert np.all(felt[:2] < 0.87 * still.ratio(LAW)[:2])


def test_a_free_load_is_followed_no_worse():
    without, with_link = (
        closed_loop(FREE, RATE, controller(link=share), grown_sine(3.0, 0.25)).error(2.0)
        for share in (None, SHARE)
    )
    assert with_link < min(0.02, without)


@pytest.mark.parametrize("load", ["free x 0.5", "free x 10"])
def test_a_free_load_with_little_drag_and_all_of_the_lag_comes_to_rest(load):
    """In full, inertia and drag are gone for the load and the lag swings a pendulum up."""
    little_drag = replace(lagging_corners(load, SET)[0], damping=1.0 - SET.damping)
    wanted = np.where(np.arange(1120) < 60, 2.0, 0.0)
    loop = controller(link=SHARE, settings=ControllerSettings(learn=False))
    ft = closed_loop(disturbed_rig(LOADS, little_drag), RATE, loop, wanted, noise=False, late=1).ft
    assert np.std(ft[-280:]) < 0.05 * np.std(ft[60:340])


def samples(seconds=3.0, hz=3.0, torque=30.0):
    """Samples of a free bench in motion."""
    plant = Plant(ENCODED_FREE, RATE, seed=1)
    return [plant.step(wave(k, torque, hz)) for k in range(round(seconds * RATE))]


def true_angles(run):
    return np.array([s.position - s.deflection for s in run])


def links(spoil=lambda k, angle: angle, run=None):
    """Return the encoder, and the angles of the link it gave; spoil: what is wrong with the sensor."""
    encoder = SpringEncoder(ENCODED, RATE)
    return encoder, np.array([
        encoder.link(SpringReading(spoil(k, s.deflection), s.ft, s.position))
        for k, s in enumerate(samples() if run is None else run)
    ])  # fmt: skip


@pytest.mark.parametrize("hz", [1.0, 20.0])
def test_a_sound_encoder_counts_after_a_quarter_of_a_second_of_motion(hz):
    run = samples(hz=hz)
    encoder, angles = links(run=run)
    assert encoder.used and encoder.losses == 0 and encoder.trouble == ""
    first = np.flatnonzero(np.isfinite(angles))[0]
    assert 0.25 * RATE <= first < 1.0 * RATE
    assert angles[first:] == pytest.approx(true_angles(run)[first:], abs=1e-12)


WRONG = {
    "frozen": lambda k, angle: 0.0,
    "wrong sign": lambda k, angle: -angle,
    "wrong scale": lambda k, angle: 3.0 * angle,
    "of another motion": lambda k, angle: 0.01 * math.sin(0.3 * k),
    "jumping": lambda k, angle: angle + 0.05 * (k % 7 == 0),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_encoder_never_counts(wrong):
    assert not np.isfinite(links(WRONG[wrong])[1]).any()


FAILS = {
    "frozen elsewhere": (lambda angle: 0.123, 0), "wrong sign": (lambda angle: -angle, 30),
    "missing": (lambda angle: math.nan, 0), "jump": (lambda angle: angle + 0.003, 0),
}  # fmt: skip
"""What an angle becomes from sample 500 on, and how many samples later it is dropped."""


@pytest.mark.parametrize("fails", FAILS)
def test_an_encoder_that_fails_is_dropped(fails):
    spoil, within = FAILS[fails]
    encoder, angles = links(lambda k, angle: spoil(angle) if k >= 500 else angle)
    assert np.isfinite(angles[300:500]).all()
    assert not np.isfinite(angles[501 + within : 540]).any()
    assert encoder.losses >= 1


def test_an_encoder_that_stops_is_off_by_little_when_it_is_dropped():
    run = samples()
    _, angles = links(lambda k, angle: run[500].deflection if k >= 500 else angle, run)
    wrong = np.abs(angles - true_angles(run))[500:]
    assert np.nanmax(wrong) < 0.6 * max(abs(s.deflection) for s in run)
    assert not np.isfinite(angles[560:]).any()


def test_a_bench_at_rest_shows_nothing_about_its_encoder():
    encoder, angles = links(run=samples(torque=0.0))
    assert not encoder.used and not np.isfinite(angles).any()


def test_a_reading_lost_now_and_then_does_not_end_the_trust():
    encoder, angles = links(lambda k, angle: math.nan if k % 50 == 0 else angle)
    assert encoder.used and encoder.losses == 0 and encoder.missing == math.ceil(len(angles) / 50)


def test_an_angle_of_the_sample_before_is_brought_to_its_instant():
    run, encoder = samples(hz=5.0), SpringEncoder(ENCODED, RATE)
    angles = np.array([
        encoder.link(SpringReading(old.deflection, new.ft, new.position, age=1.0))
        for old, new in pairwise(run)
    ])  # fmt: skip
    plain, ready = np.array([n.position - o.deflection for o, n in pairwise(run)]), np.isfinite(angles)
    off, before = (np.std((a - true_angles(run[1:]))[ready]) for a in (angles, plain))
    assert encoder.losses == 0 and off < 0.5 * before


@pytest.mark.parametrize("phase", [0.0, 1.5])
@pytest.mark.parametrize("gap", [0, 7, 100])
def test_the_links_torque_comes_and_goes_without_a_jump_wherever_the_link_is(phase, gap):
    """It took the speed for zero at a start, and for the mean over a gap: 15 times the acceleration."""
    motion = LinkMotion(LAW, SHARE)
    angle = lambda k: 0.01 * math.sin(2.0 * math.pi * 3.0 * k / RATE + phase)  # noqa: E731
    steady = [motion.torque(angle(k), 0.0) for k in range(400)]
    most = max(map(abs, steady[200:]))
    assert max(map(abs, steady)) < 1.1 * most
    lost = [steady[-1], *(motion.torque(math.nan, 0.0) for _ in range(gap))]
    assert np.abs(np.diff(lost)).max(initial=0.0) < 0.5 * most and (gap < 100 or abs(lost[-1]) < 1e-6)
    again = [motion.torque(angle(k), 0.0) for k in range(400 + gap, 600 + gap)]
    assert max(map(abs, again)) < 1.2 * most
    assert all(LinkMotion(LAW, LinkShare()).torque(angle(k), 0.0) == 0.0 for k in range(10))


def test_an_angle_that_jumps_takes_a_bounded_torque():
    """Where ft is the stiffness times the deflection the two agree also in a jump."""
    motion = LinkMotion(LAW, SHARE, most=5.0)
    torques = [motion.torque(0.5 * (k == 20) + 1e-3 * k, 0.0) for k in range(60)]
    assert 1.0 < max(map(abs, torques)) <= 5.0 and abs(torques[-1]) < 0.1 + abs(torques[19])


class Checked(TorqueController):
    """The controller behind the check, as the node has it; spoil: what the encoder makes of the angle."""

    def __init__(self, spoil):
        self.encoder, self.spoil, self.count = SpringEncoder(ENCODED, RATE), spoil, 0
        super().__init__(ENCODED, RATE, GAINS, link=SHARE)

    def step(self, reading, desired, *given, **named):
        self.count += 1
        deflection = self.spoil(self.count, reading.position - reading.link)
        link = self.encoder.link(SpringReading(deflection, reading.ft, reading.position))
        return super().step(replace(reading, link=link), desired, *given, **named)


def test_in_the_loop_a_sound_encoder_helps_and_a_failing_one_is_as_none():
    follow = lambda loop, s=4.0: closed_loop(ENCODED_FREE, RATE, loop, grown_sine(s, 1.0))  # noqa: E731
    without, sound = follow(TorqueController(ENCODED, RATE, GAINS)), Checked(lambda k, angle: angle)
    assert follow(sound).error(2.5) < without.error(2.5) and sound.encoder.losses == 0
    for spoil in (lambda k, angle: -angle, lambda k, angle: 0.0):
        assert np.array_equal(follow(Checked(spoil), 1.5).command, without.command[:420])
    dying = follow(Checked(lambda k, angle: angle if k < 800 else math.nan))
    assert np.abs(np.diff(dying.command)[780:860]).max() < 1.2 * np.abs(np.diff(without.command)[560:]).max()
    assert dying.error(3.4) == pytest.approx(without.error(3.4), rel=0.2)


def test_without_an_angle_the_controller_is_the_one_without_encoder():
    with_share, plain = controller(link=SHARE), controller()
    for k in range(50):
        reading = Measurement(math.sin(0.1 * k), 0.01, 0.001 * k, 0.5)
        assert with_share.step(reading, 1.0) == plain.step(reading, 1.0)
