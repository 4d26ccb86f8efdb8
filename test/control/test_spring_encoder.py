"""The encoder on the spring counts while it agrees with ft, and never before."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from rsea_ros.control.controller import Measurement, TorqueController
from rsea_ros.control.following import closed_loop
from rsea_ros.control.law import Gains, law_of
from rsea_ros.control.link import LinkMotion, LinkShare
from rsea_ros.control.spring_encoder import SpringEncoder, SpringReading
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant

RATE = 280.0
GAINS, SHARE = Gains(0.2575, 0.003029, 1.195, 6.99, 42.9), LinkShare(0.25, 0.4, 20.0)
NOISE = {"deflection": Sensor(noise=5e-6)}


def with_encoder(name):
    rig = load_rig(name)
    return replace(rig, sensors={**rig.sensors, **NOISE})


RIG, FREE = with_encoder("paper_high_impedance"), with_encoder("paper_moving_output")


def samples(rig=FREE, seconds=3.0, hz=3.0, torque=30.0):
    """Samples of a bench in motion."""
    plant = Plant(rig, RATE, seed=1)
    n = np.arange(round(seconds * RATE))
    wave = torque * np.sin(2.0 * np.pi * hz * n / RATE)
    return [plant.step(u) for u in wave]


def links(spoil=lambda k, angle: angle, run=None, rig=RIG):
    """Return the encoder, and the angles of the link it gave; spoil: what is wrong with the sensor."""
    encoder = SpringEncoder(rig, RATE)
    run = samples() if run is None else run
    return encoder, [
        encoder.link(SpringReading(spoil(k, s.deflection), s.ft, s.position)) for k, s in enumerate(run)
    ]


@pytest.mark.parametrize("hz", [1.0, 20.0])
def test_a_sound_encoder_counts_after_a_quarter_of_a_second_of_motion(hz):
    run = samples(hz=hz)
    encoder, angles = links(run=run)
    assert encoder.used and encoder.losses == 0 and encoder.trouble == ""
    first = next(k for k, angle in enumerate(angles) if math.isfinite(angle))
    assert 0.25 * RATE <= first < 1.0 * RATE
    true = [s.position - s.deflection for s in run]
    assert angles[first:] == pytest.approx(true[first:], abs=1e-12)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda k, angle: 0.0,
        lambda k, angle: -angle,
        lambda k, angle: 3.0 * angle,
        lambda k, angle: 0.01 * math.sin(0.3 * k),
        lambda k, angle: angle + 0.05 * (k % 7 == 0),
    ],
    ids=["frozen", "wrong sign", "wrong scale", "of another motion", "jumping"],
)
def test_a_wrong_encoder_never_counts(spoil):
    _, angles = links(spoil)
    assert not np.isfinite(angles).any()


@pytest.mark.parametrize(
    ("spoil", "within"),
    [
        (lambda k, angle: 0.123 if k >= 500 else angle, 0),
        (lambda k, angle: -angle if k >= 500 else angle, 30),
        (lambda k, angle: math.nan if k >= 500 else angle, 0),
        (lambda k, angle: angle + 0.003 if k >= 500 else angle, 0),
    ],
    ids=["frozen elsewhere", "wrong sign", "missing", "jump"],
)
def test_an_encoder_that_fails_is_dropped(spoil, within):
    encoder, angles = links(spoil)
    assert np.isfinite(angles[300:500]).all()
    assert not np.isfinite(angles[501 + within : 540]).any()
    assert encoder.losses >= 1


def test_an_encoder_that_stops_is_off_by_little_when_it_is_dropped():
    run = samples()
    stopped = run[500].deflection
    _, angles = links(lambda k, angle: stopped if k >= 500 else angle, run)
    true = np.array([s.position - s.deflection for s in run])
    wrong = np.abs(np.array(angles) - true)[500:]
    assert np.nanmax(wrong) < 0.6 * max(abs(s.deflection) for s in run)
    assert not np.isfinite(angles[560:]).any()


def test_a_bench_at_rest_shows_nothing_about_its_encoder():
    encoder, angles = links(run=samples(torque=0.0))
    assert not encoder.used and not np.isfinite(angles).any()


def test_a_reading_lost_now_and_then_does_not_end_the_trust():
    encoder, angles = links(lambda k, angle: math.nan if k % 50 == 0 else angle)
    assert encoder.used and encoder.losses == 0 and encoder.missing == math.ceil(len(angles) / 50)


def test_an_angle_of_the_sample_before_is_brought_to_its_instant():
    run = samples(hz=5.0)
    encoder = SpringEncoder(RIG, RATE)
    angles = [
        encoder.link(SpringReading(old.deflection, new.ft, new.position, age=1.0))
        for old, new in pairwise(run)
    ]
    true = np.array([s.position - s.deflection for s in run[1:]])
    plain = np.array([new.position - old.deflection for old, new in pairwise(run)])
    ready = np.isfinite(angles)
    off, before = (np.sqrt(np.mean((a - true)[ready] ** 2)) for a in (np.array(angles), plain))
    assert encoder.losses == 0 and off < 0.5 * before


@pytest.mark.parametrize("phase", np.linspace(0.0, 2.0 * math.pi, 4, endpoint=False))
@pytest.mark.parametrize("gap", [0, 7, 100])
def test_the_links_torque_comes_back_without_a_jump_wherever_the_link_is(phase, gap):
    """It took the speed for zero at a start, and for the mean over a gap: 15 times the acceleration."""
    motion = LinkMotion(law_of(RIG, RATE, GAINS), SHARE)
    angle = lambda k: 0.01 * math.sin(2.0 * math.pi * 3.0 * k / RATE + phase)  # noqa: E731
    steady = [motion.torque(angle(k), 0.0) for k in range(400)]
    most = max(map(abs, steady[200:]))
    assert max(map(abs, steady)) < 1.1 * most
    for _ in range(gap):
        motion.torque(math.nan, 0.0)
    again = [motion.torque(angle(k), 0.0) for k in range(400 + gap, 600 + gap)]
    assert max(map(abs, again)) < 1.2 * most


def test_an_angle_that_jumps_takes_a_bounded_torque():
    """Where ft is the stiffness times the deflection the two agree also in a jump."""
    motion = LinkMotion(law_of(RIG, RATE, GAINS), SHARE, most=5.0)
    torques = [motion.torque(0.5 * (k == 20) + 1e-3 * k, 0.0) for k in range(60)]
    assert 1.0 < max(map(abs, torques)) <= 5.0 and abs(torques[-1]) < 0.1 + abs(torques[19])


class Checked(TorqueController):
    """The controller behind the check, as the node has it; spoil: what the encoder makes of the angle."""

    def __init__(self, spoil, **options):
        self.encoder, self.spoil, self.count = SpringEncoder(RIG, RATE), spoil, 0
        super().__init__(RIG, RATE, GAINS, link=SHARE, **options)

    def step(self, reading, desired, *given, **named):
        self.count += 1
        deflection = self.spoil(self.count, reading.position - reading.link)
        link = self.encoder.link(SpringReading(deflection, reading.ft, reading.position))
        return super().step(replace(reading, link=link), desired, *given, **named)


def follow(controller):
    t = np.arange(1120) / RATE
    wanted = 4.2 * np.minimum(1.0, t) ** 2 * np.sin(2.0 * np.pi * 5.0 * t)
    return closed_loop(FREE, RATE, controller, wanted)


def test_in_the_loop_a_sound_encoder_helps_and_a_failing_one_is_as_none():
    without = follow(TorqueController(RIG, RATE, GAINS))
    sound = Checked(lambda k, angle: angle)
    assert follow(sound).error(2.5) < without.error(2.5) and sound.encoder.losses == 0
    for spoil in (lambda k, angle: -angle, lambda k, angle: 0.0):
        assert np.array_equal(follow(Checked(spoil)).command, without.command)
    dying = follow(Checked(lambda k, angle: angle if k < 800 else math.nan))
    assert np.abs(np.diff(dying.command)[780:860]).max() < 1.2 * np.abs(np.diff(without.command)[560:]).max()
    assert dying.error(3.4) == pytest.approx(without.error(3.4), rel=0.2)


def test_without_an_angle_the_controller_is_the_one_without_encoder():
    with_share = TorqueController(RIG, RATE, GAINS, link=SHARE)
    plain = TorqueController(RIG, RATE, GAINS)
    for k in range(50):
        reading = Measurement(math.sin(0.1 * k), 0.01, 0.001 * k, 0.5)
        assert with_share.step(reading, 1.0) == plain.step(reading, 1.0)
