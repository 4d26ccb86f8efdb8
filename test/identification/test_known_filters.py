"""Sensors that are known to filter, on a bench in plain Python that shares no code with the simulation."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from runs import RATE, RIG

from rsea_ros import simulate
from rsea_ros.checks.pairs import pairs_of
from rsea_ros.diagnosis.data_split import as_often_as_commands
from rsea_ros.identification.identify import identify
from rsea_ros.identification.noise_level import is_noise
from rsea_ros.identification.problem import case_from
from rsea_ros.model.rig import Sensor
from rsea_ros.model.sensor_filter import SensorFilter
from rsea_ros.model.simulation import simulate as outputs
from rsea_ros.records.record import Channel, Record

SUBSTEPS = 40
POLE, RATIO = 0.036, 2000.0
FT_NOISE, ANGLE_NOISE = 0.03, 3e-6
K, J, B, B_S = 1592.0, 0.89, 27.7, 3.0
TRUE = {
    "spring.stiffness": K, "rotor.reflected_inertia": J, "rotor.reflected_damping": B, "spring.damping": B_S,
}  # fmt: skip
PLAIN = replace(RIG, sensors={"ft": Sensor(noise=FT_NOISE), "deflection": Sensor(noise=ANGLE_NOISE)})
FILTERS = {"ft": SensorFilter("one_pole", (POLE,)), "deflection": SensorFilter("kalman", (RATIO,))}
KNOWN = replace(PLAIN, sensors={n: replace(s, filter=FILTERS[n]) for n, s in PLAIN.sensors.items()})


class Kalman:
    """Of a constant velocity, with its covariance: no steady gain."""

    def __init__(self, first):
        self.x, self.v, self.p, self.q, self.r = first, 0.0, 1.0, 0.0, 1.0

    def __call__(self, measured):
        t, a = 1.0 / RATE, RATIO**2
        self.x += t * self.v
        self.p += 2.0 * t * self.q + t * t * self.r + a * t**4 / 4.0
        self.q += t * self.r + a * t**3 / 2.0
        self.r += a * t * t
        gain, rate = self.p / (self.p + 1.0), self.q / (self.p + 1.0)
        surprise = measured - self.x
        self.x, self.v = self.x + gain * surprise, self.v + rate * surprise
        self.r -= rate * self.q
        self.p, self.q = (1.0 - gain) * self.p, (1.0 - gain) * self.q
        return self.x


@functools.cache
def bench_record(seed, seconds=25):
    """Return a run of a bench with both ends clamped: an F/T chain with a pole, a tracked spring encoder."""
    rng = np.random.default_rng(seed)
    command = 15.0 * rng.standard_normal(int(seconds * RATE))
    j, h = J + RIG["chassis.inertia"], 1.0 / RATE / SUBSTEPS
    kept, kept_noise = math.exp(-h / POLE), math.exp(-1.0 / RATE / POLE)
    q = v = torque = hum = 0.0
    track, shown = Kalman(0.0), []
    for u in command.tolist():
        for _ in range(SUBSTEPS):  # the midpoint rule
            half = v + 0.5 * h * (u - (B + B_S) * v - K * q) / j
            middle = q + 0.5 * h * v
            torque += (1.0 - kept) * (K * middle + B_S * half - torque)
            q, v = q + h * half, v + h * (u - (B + B_S) * half - K * middle) / j
        hum += (1.0 - kept_noise) * (FT_NOISE * rng.standard_normal() - hum)
        shown.append((torque + hum, track(q + ANGLE_NOISE * rng.standard_normal())))
    t = np.arange(len(command)) / RATE
    ft, deflection = np.array(shown).T
    measured = {"ft": Channel(t + 1.0 / RATE, ft), "deflection": Channel(t + 1.0 / RATE, deflection)}
    return Record({"command": Channel(t, command), **measured}, source="plain bench")


def test_a_fit_with_the_filters_stated_recovers_the_bench_and_leaves_noise():
    """Within 95 % intervals: of 24 seeds 7 of 96 values lay outside of theirs."""
    fitted = identify([bench_record(101)], KNOWN)
    for p in fitted.parameters:
        low, high = p.ci95
        assert low < TRUE[p.name] < high < low + 0.02 * TRUE[p.name], p.name
    assert all(0.7 < fitted.residual_rms[n] / fitted.noise_rms[n] < 1.1 for n in ("ft", "deflection"))


def test_a_fit_without_them_does_not():
    fitted = identify([bench_record(101)], PLAIN, of_misfit=False)
    values = {p.name: p.value for p in fitted.parameters}
    assert abs(values["rotor.reflected_inertia"] / J - 1.0) > 0.1
    assert all(fitted.residual_rms[n] > 20.0 * fitted.noise_rms[n] for n in ("ft", "deflection"))


@pytest.mark.parametrize(
    ("kind", "numbers"),
    [("one_pole", (0.036,)), ("two_poles", (12.0, 0.4)), ("average", (5.0,)), ("alpha_beta", (0.9, 0.8))],
)
def test_noise_that_a_filter_has_coloured_is_noise(kind, numbers):
    """An average has lobes and a tracker a peak, as no other sensor; a wrong damping is no noise."""
    known = SensorFilter(kind, numbers)
    rig = replace(PLAIN, sensors={n: replace(s, filter=known) for n, s in PLAIN.sensors.items()})
    record = simulate(rig, 15.0 * np.random.default_rng(7).standard_normal(7000), RATE, seed=7)
    case, made = case_from(record, rig), outputs(rig, record)
    assert all(is_noise(case, made, n) for n in rig.sensors)
    damping = "rotor.reflected_damping"
    wrong = outputs(rig.with_values({damping: 1.01 * rig[damping]}), record)
    assert not any(is_noise(case, wrong, n) for n in rig.sensors)


def test_two_sensors_are_compared_behind_the_filters_of_both():
    """Their law is the spring's; without, a right spring looked wrong."""

    def spring(rig):
        found = pairs_of(bench_record(101), rig)
        return next(pair for pair in found if (pair.law.y, pair.law.x) == ("ft", "deflection"))

    known, plain = spring(KNOWN), spring(PLAIN)
    assert known.fits and known.factor * RIG["spring.stiffness"] == pytest.approx(K, rel=0.02)
    assert not plain.fits or abs(plain.factor * RIG["spring.stiffness"] / K - 1.0) > 0.1


def test_a_filter_at_the_samples_keeps_all_of_them():
    """A search looks at a sample for each command; a filter has seen all."""
    t = np.arange(2000) / 1000.0
    command, fast = Channel(t[::4], np.sin(9.0 * t[::4])), Channel(t, t)
    fast = Record({"command": command, "ft": fast, "deflection": fast})
    thinner = as_often_as_commands(case_from(fast, KNOWN))
    assert (len(thinner.t["ft"]), len(thinner.t["deflection"])) == (500, 2000)
