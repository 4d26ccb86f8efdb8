"""The controller's reading of an encoder on the spring: used where the rig has one, never when it is off."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.control.law import Gains
from rsea_ros.control.link import LinkShare, SpringEncoder
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.control.uncertainty import Uncertainty
from rsea_ros.model.rig import EffectSetting, Sensor
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.model.simulation import Plant
from rsea_ros.nodes import _control as _measurements
from rsea_ros.nodes._control import TABLE, link_of, summary, with_limits

RATE = 280.0
EPOCH, PERIOD = 1_700_000_000_000_000_000, 1e9 / RATE
SET = Uncertainty(delay=2e-3, mode=(33.0, 0.02, 0.3))
DESIGN = ControllerDesign(Gains(0.2575, 0.003029, 1.195, 6.99, 42.9), RATE, {}, math.nan, uncertainty=SET)
ENCODER = {"deflection": Sensor(noise=5e-6)}


def bench(name="paper_high_impedance", sensors=ENCODER, effects=()):
    rig = load_rig(name).with_effects(*effects)
    return replace(rig, sensors={**rig.sensors, **sensors})


def values(rig, path, **given):
    save_rig(rig, path / "model.yaml")
    return with_limits({**{p.name: p.default for p in TABLE}, "rig": str(path / "model.yaml"), **given})


def test_the_log_says_which_mode_a_design_tolerates_or_that_it_knows_none():
    told = [" ".join(summary(replace(DESIGN, uncertainty=u))) for u in (SET, replace(SET, mode=None))]
    assert ["33 Hz" in words for words in told] == [True, False]
    assert ["no mode of the F/T sensor's mount: `uncertainty`" in words for words in told] == [False, True]


def test_it_is_used_where_the_rig_has_the_sensor(tmp_path):
    link = link_of(values(bench(), tmp_path, impedance=1.2), DESIGN)
    assert link.share == LinkShare(0.25, 0.4, 20.0) and link.encoder is not None
    assert "once deflection agrees with ft" in str(link)
    assert link.values()["link"].startswith("not used: deflection and ft have not been compared")


@pytest.mark.parametrize(
    ("rig", "given", "reason"),
    [
        (bench(), {"link": False}, "link is false"),
        (bench(sensors={}), {}, "the rig has no sensor deflection"),
        (bench(effects=[EffectSetting("backlash", {"gap": 1e-3})]), {}, "backlash"),
        (bench(sensors={"deflection": Sensor(quantum=1.5e-3)}), {}, "of motor torque, expected at most 1.4"),
    ],
)
def test_it_is_not_used_and_the_node_says_why(tmp_path, rig, given, reason):
    link = link_of(values(rig, tmp_path, **given), DESIGN)
    assert link.share == LinkShare() and link.encoder is None
    assert reason in str(link) and reason in link.values()["link"]


class Post(dict):
    """Mailboxes by topic, filled by the test."""

    def __call__(self, node, topic, *args, **options):
        self[topic] = Box()
        return self[topic]


class Box(list):
    """The messages of a topic: stamp and numbers."""

    subscription = None

    def take(self, most=None):
        taken, self[:] = list(self), []
        return [(stamp, numbers, stamp) for stamp, numbers in taken]


@pytest.fixture(scope="module")
def run():
    """Samples of a free bench in motion."""
    plant = Plant(bench("paper_moving_output"), RATE, seed=1)
    return [plant.step(30.0 * math.sin(2.0 * math.pi * 3.0 * k / RATE)) for k in range(600)]


def read(monkeypatch, run, deflections, together=1):
    """Return encoder and the link's angles; deflections: k, sample to what is published with it: (off, angle)
    in periods and rad. together: samples that arrive at once."""
    post, encoder = Post(), SpringEncoder(bench(), RATE)
    monkeypatch.setattr(_measurements, "Mailbox", post)
    inputs = _measurements.Measurements(None, "torque.z", PERIOD, "joint", encoder=encoder)
    link_states = []
    for k, s in enumerate(run):
        stamp = round(EPOCH + k * PERIOD)
        post["joint_states"].append((stamp, (s.position, s.velocity, 0.0)))
        post["ft"].append((stamp, (s.ft,)))
        post["deflection"] += [(round(stamp + off * PERIOD), (angle,)) for off, angle in deflections(k, s)]
        if (k + 1) % together == 0:
            link_states += inputs.take()
    return encoder, np.array([reading.link for _, reading in link_states])


def truth(run):
    return np.array([s.position - s.deflection for s in run])


@pytest.mark.parametrize("together", [1, 3])
def test_the_links_angle_is_the_position_less_the_deflection(monkeypatch, run, together):
    encoder, links = read(monkeypatch, run, lambda k, s: [(0.0, s.deflection)], together)
    used = np.isfinite(links)
    assert encoder.used and len(links) == len(run) and used.sum() > 400
    assert links[used] == pytest.approx(truth(run)[used], abs=1e-12)


def test_a_deflection_that_comes_after_its_sample_is_used_with_the_next(monkeypatch, run):
    """A driver of another make may publish it last."""
    before = [run[0], *run]
    encoder, links = read(monkeypatch, run, lambda k, s: [(-1.0, before[k].deflection)])
    used = np.isfinite(links)
    assert encoder.losses == 0 and used.sum() > 400
    assert links[used] == pytest.approx(truth(run)[used], abs=3e-4)


@pytest.mark.parametrize(
    "deflections",
    [
        lambda k, s: [],
        lambda k, s: [(-2.0, s.deflection)],
        lambda k, s: [(30.0, s.deflection)],
        lambda k, s: [(0.0, s.deflection)] if k < 1 else [],
        lambda k, s: [(0.0, math.nan)],
        lambda k, s: [(0.0, 0.01)],
        lambda k, s: [(0.0, -s.deflection)],
    ],
    ids=["none", "old", "of the future", "one only", "not a number", "frozen", "wrong sign"],
)
def test_a_deflection_that_is_off_is_none(monkeypatch, run, deflections):
    encoder, links = read(monkeypatch, run, deflections)
    assert len(links) == len(run) and not np.isfinite(links).any() and not encoder.used


def test_an_encoder_that_falls_silent_is_counted_and_shown(monkeypatch, run, tmp_path):
    encoder, links = read(monkeypatch, run, lambda k, s: [(0.0, s.deflection)] if k < 400 else [])
    assert np.isfinite(links[300:400]).all() and not np.isfinite(links[402:]).any()
    link = link_of(values(bench(), tmp_path), DESIGN)._replace(encoder=encoder)
    shown = link.values()
    assert shown["link"] == "not used: no deflection"
    assert (shown["link_losses"], shown["missing_deflections"]) == (1, encoder.missing)
    assert 190 <= encoder.missing <= 200


def test_without_an_encoder_the_topic_is_not_heard(monkeypatch):
    post = Post()
    monkeypatch.setattr(_measurements, "Mailbox", post)
    _measurements.Measurements(None, "torque.z", PERIOD, "joint")
    assert set(post) == {"joint_states", "ft", "desired_torque"}


def test_after_a_jump_of_the_stamps_agreement_is_seen_anew(monkeypatch, run):
    encoder, _ = read(monkeypatch, run, lambda k, s: [(0.0, s.deflection)])
    at = round(EPOCH - 10 * 1e9)
    assert encoder.used
    post = Post()
    monkeypatch.setattr(_measurements, "Mailbox", post)
    inputs = _measurements.Measurements(None, "torque.z", PERIOD, "joint", encoder=encoder)
    post["joint_states"].append((at, (0.0, 0.0, 0.0)))
    post["ft"].append((at, (0.0,)))
    post["deflection"].append((at, (0.0,)))
    assert [math.isnan(reading.link) for _, reading in inputs.take()] == [True]
    assert not encoder.used and encoder.losses == 1
