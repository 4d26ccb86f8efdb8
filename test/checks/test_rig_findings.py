"""Findings on clocks, drifts, values and another machine, from numbers put in and on whole records."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run

import rsea_ros as rsea
from rsea_ros.checks import rig_findings
from rsea_ros.checks.check import check_record
from rsea_ros.checks.linearised_rig import Number
from rsea_ros.checks.rig_findings import (
    _far,
    _identifiability,
    at_rates,
    clock_findings,
    clock_rates,
    drift_findings,
    lag_lines,
    residual_shares,
    restoring_findings,
)
from rsea_ros.checks.verdicts import RIGHT_RIG
from rsea_ros.identification.clocks import LagLine
from rsea_ros.identification.result import ParameterEstimate, Remark
from rsea_ros.model.inverse import Motion
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

US = 1e-6
SAID = "against the model; a delay of the drive looks the same"


def linear(offset, drift=None, *, settled=True, fits=True, misfit=None):
    """Return a fit: offsets and drifts by channel, (value, sd) in us and ppm."""
    made = {n: Number(US * v, US * s) for n, (v, s) in offset.items()}
    grows = drift or dict.fromkeys(offset, (0.0, 0.1))
    drifts = {n: Number(US * v, US * s) for n, (v, s) in grows.items()}
    alike = dict.fromkeys(offset, 1.0) | (misfit or {})
    return SimpleNamespace(settled=settled, fits=fits, offset=made, drift=drifts, misfit=alike)


def told(*given, **options):
    return {(f.kind, f.channel): f for f in clock_findings(linear(*given, **options), 100.0)}


@pytest.mark.parametrize(
    ("offset", "options", "light"),
    [
        ({"ft": (310.0, 10.0), "position": (0.0, 10.0)}, {}, "amber"),
        ({"ft": (-310.0, 10.0), "position": (0.0, 10.0)}, {}, "amber"),
        ({"ft": (290.0, 10.0), "position": (0.0, 10.0)}, {}, "green"),
        ({"ft": (310.0, 70.0), "position": (0.0, 40.0)}, {}, "green"),  # 4 of 81 us
        ({"ft": (330.0, 70.0), "position": (0.0, 40.0)}, {}, "amber"),
        ({"ft": (310.0, 10.0), "position": (0.0, 10.0)}, {"fits": False}, "green"),
        ({"ft": (310.0, 10.0)}, {}, "green"),
        ({"ft": (310.0, 10.0), "position": (0.0, 30.0), "velocity": (200.0, 5.0)}, {}, "green"),
        ({"ft": (310.0, 10.0), "position": (0.0, 3.0), "velocity": (200.0, 5.0)}, {}, "amber"),
        ({"ft": (0.0, 10.0), "position": (310.0, 10.0)}, {}, "amber"),
    ],
)
def test_a_sensor_off_the_others_is_late_from_three_tenths_of_a_millisecond_on(offset, options, light):
    found = told(offset, **options)["clock_offset", "ft"]
    assert (found.light, found.unit, found.expected) == (light, "µs", "within 300 µs of the others")
    value, sd = offset["ft"]
    assert (found.value, found.low, found.high) == pytest.approx(value + 1.959964 * sd * np.array([0, -1, 1]))
    apart = value - offset.get("position", (0.0,))[0]
    assert found.detail == (f"{apart:.4g} µs later than position, {SAID}" if light == "amber" else SAID)
    assert bool(found.remedy) == (light == "amber")
    others = [f for (kind, n), f in told(offset, **options).items() if n != "ft" and kind == "clock_offset"]
    assert all(f.light == "green" and not f.remedy for f in others)


@pytest.mark.parametrize(
    ("drift", "fits", "light"),
    [((3.1, 0.1), True, "amber"), ((-3.1, 0.1), True, "amber"), ((2.9, 0.1), True, "green"),
     ((3.9, 1.0), True, "green"), ((4.1, 1.0), True, "amber"), ((3.1, 0.1), False, "green")],
)  # fmt: skip
def test_a_drift_counts_from_three_tenths_of_a_millisecond_by_the_end(drift, fits, light):
    found = told({"ft": (0.0, 1.0)}, {"ft": drift}, fits=fits)["clock_drift", "ft"]
    assert (found.light, found.unit, found.expected) == (light, "ppm", "within 3 ppm")
    value, sd = drift
    assert (found.value, found.low, found.high) == pytest.approx(value + 1.959964 * sd * np.array([0, -1, 1]))
    assert found.detail == "of its clock against the command's" and bool(found.remedy) == (light == "amber")


def test_a_clock_that_the_data_leave_open_or_a_cause_may_imitate_is_said():
    grows = {"ft": (0.0, 30.01), "position": (0.0, 29.9)}
    found = told({"ft": (0.0, 3001.0), "position": (0.0, 2999.0)}, grows)
    assert found["clock_offset", "ft"].detail == "not determined: these data leave 3 ms, one sigma"
    assert found["clock_drift", "ft"].detail == "not determined: these data leave 3 ms, one sigma"
    assert found["clock_offset", "position"].detail == SAID and found["clock_drift", "position"].unit == "ppm"
    beside = told({"ft": (0.0, 1.0), "position": (0.0, 1.0)}, misfit={"ft": 7.2, "position": 1.99})
    words = "beside a misfit of 7 times the noise a cause may stand in for it"
    assert beside["clock_offset", "ft"].detail == f"{SAID}; {words}"
    assert beside["clock_drift", "ft"].detail == f"of its clock against the command's; {words}"
    assert beside["clock_offset", "position"].detail == SAID
    (open_,) = clock_findings(linear({"ft": (0.0, 1.0)}, settled=False), 100.0)
    assert (open_.light, open_.detail) == ("green", "not determined beside what the rig leaves")


def test_a_value_is_determined_or_far_from_the_rigs():
    interval = (100.0 - 1.959964 * 3.0, 100.0 + 1.959964 * 3.0)

    def estimate(share, value=100.0):
        return ParameterEstimate("spring.stiffness", value, "N m/rad", interval, 100.0, 0.1, share)

    known, open_ = _identifiability(estimate(0.99)), _identifiability(estimate(0.01))
    assert (known.light, known.value, known.unit) == ("green", pytest.approx(3.0, rel=1e-5), "%")
    assert known.detail == "one sigma that these data leave" and not known.remedy
    assert open_.light == "amber" and open_.detail.startswith("one sigma, only with") and open_.remedy
    assert _identifiability(estimate(0.99, 0.0)).value == pytest.approx(300.0, rel=1e-5)
    remark = Remark("off_rig", ("spring.stiffness",), (1500.0, 900.0, 890.0, 910.0, 4.0), "N m/rad")
    far = _far(remark, SimpleNamespace(spread=lambda name: 0.1))
    assert (far.light, far.kind, far.channel, far.value, far.low, far.high, far.unit) == (
        "amber", "rig_value", "spring.stiffness", 900.0, 890.0, 910.0, "N m/rad")  # fmt: skip
    assert far.expected == "1500, to 30 %" and far.detail == "fitted, 4 of the rig's stated spreads away"


def test_a_rate_of_a_clock_is_a_clear_line_that_is_not_too_steep():
    lines = {
        "ft": LagLine(1e-3, 1e-3, 0.1, 0.0), "position": LagLine(-1e-3, 0.0249, -0.1, 0.0),
        "velocity": LagLine(1e-3, 0.0251, 0.1, 0.0), "deflection": LagLine(1.81e-3, 1e-4, 0.1, 0.0),
        "motor_torque": LagLine(1e-5, 1e-5, 1e-3, 0.0), "command": LagLine(1e-5, 1e-5, 1.01e-3, 0.0),
    }  # fmt: skip
    assert clock_rates(lines) == {"ft": 1e-3, "position": -1e-3, "command": 1e-5}


def test_lines_are_those_of_sensors(monkeypatch):
    monkeypatch.setattr(rig_findings, "lag_line", lambda t, y, p, start: (y, p, start) if y else None)
    side = SimpleNamespace
    given = {"ft": side(t=0, y=1, p=2), "position": side(t=0, y=0, p=2), "command": side(t=0, y=1, p=2)}
    assert lag_lines(given, 5.0) == {"ft": (1, 2, 5.0)}


RUN = Record({n: Channel(10.0 + np.arange(5.0), np.zeros(5)) for n in ("command", "ft", "motor_torque")})
STRAIGHT = {"bend": 1e-5, "scatter": 1e-4}


def line(rate, *, rise=0.01, **more):
    return LagLine(rate, rise=rise, **{**STRAIGHT, **more})


def drifts(monkeypatch, lines, behind):
    """Return findings. behind: line of each channel behind each partner."""
    monkeypatch.setattr(rig_findings, "predicted", lambda record, pair, name: behind.get((name, pair.law.x)))
    monkeypatch.setattr(rig_findings, "lag_line", lambda t, y, expected, start: expected)
    partners = dict.fromkeys(x for _, x in behind)
    pairs = [SimpleNamespace(law=SimpleNamespace(x=x)) for x in partners]
    return [(f.light, f.channel, round(f.value, 6), f.detail) for f in drift_findings(RUN, lines, pairs)]


OF = "of its clock against the command's; seen between ft and position"
BESIDE = "seen beside a misfit of the rig, for which a cause may stand in for it"
POOR = f"of its clock against the command's; {BESIDE}"


@pytest.mark.parametrize(
    ("lines", "behind", "expected"),
    [
        ({}, {}, []),
        ({"ft": line(1e-4), "position": line(1e-4, bend=2.1e-5)}, {}, [("green", "ft", 100.0, POOR)]),
        ({"ft": line(1e-4)}, {("ft", "position"): line(1e-4, bend=2.1e-5)}, [("green", "ft", 100.0, POOR)]),
        ({"ft": line(1e-4), "position": line(0.0)}, {("ft", "position"): line(1e-4)},
         [("amber", "ft", 100.0, OF)]),
        # the joint's clock runs: ft keeps to the command, and the joint's lines say the opposite
        ({"ft": line(0.0), "position": line(-1e-4), "velocity": line(-1e-4)},
         {("ft", "position"): line(1e-4)},
         [("amber", "position", -100.0, OF), ("amber", "velocity", -100.0, OF)]),
        ({"ft": line(0.5e-4), "position": line(-0.5e-4)}, {("ft", "position"): line(1e-4)},
         [("amber", "ft", 100.0, OF)]),
        # a motor torque behind the command is of the joint's clock, whatever the rig's lines say
        ({"ft": line(1e-4), "position": line(0.0)},
         {("ft", "position"): line(1e-4), ("motor_torque", "command"): line(-1e-4)},
         [("amber", "position", -100.0, OF)]),
        ({"ft": line(1e-4)},
         {("ft", "position"): line(1e-4), ("ft", "deflection"): line(9e-4, scatter=2e-4)},
         [("amber", "ft", 100.0, OF)]),
        ({"ft": line(1e-4)}, {("ft", "position"): line(1e-4, rise=9e-4)}, [("green", "ft", 100.0, POOR)]),
    ],
)  # fmt: skip
def test_a_drift_is_of_ft_unless_the_joint_plainly_runs_otherwise(monkeypatch, lines, behind, expected):
    assert drifts(monkeypatch, lines, behind) == expected


def test_stamps_of_a_fast_clock_are_taken_back_from_the_first_command_on():
    moved = at_rates(RUN, {"ft": 0.5})
    assert moved["ft"].t.tolist() == [10.0, 10.5, 11.0, 11.5, 12.0]
    assert moved["motor_torque"] is RUN["motor_torque"]


def motion(stiffness, noise, n=2000):
    t = np.arange(n) * 0.01
    q = 0.5 * np.sin(2.1 * t) + 0.2 * np.sin(5.3 * t + 1.0)
    v, a = (np.gradient(x, t) for x in (q, np.gradient(q, t)))
    torque = 0.9 * a + 2.0 * v + 1.5 * np.tanh(v / (0.05 * np.std(v))) + 0.7 + stiffness * q
    torque = torque + noise * np.random.default_rng(1).standard_normal(n)
    return Motion(t, q, v, a, torque, np.zeros(n, bool))


def test_what_the_position_explains_is_a_spring_that_the_rig_lacks(monkeypatch):
    given = motion(3.0, 0.2)
    without, held = residual_shares(given)
    edge = slice(40, -40)
    left = np.std(given.torque[edge])
    assert held == pytest.approx(0.2 / left, rel=0.05) and without > 1.5 * held
    early = given.t < 10.0
    half = replace(given, torque=np.where(early, given.torque, 9e9), counts=early)
    assert residual_shares(half)[1] == pytest.approx(held, rel=0.3)
    rig = {"spring_end.stiffness": 0.0, "spring_end.gravity": 0.0}
    monkeypatch.setattr(rig_findings, "motion_from", lambda record: given)
    for shares, is_told in (((0.5, 0.274), True), ((0.5, 0.276), False)):
        monkeypatch.setattr(rig_findings, "residual_shares", lambda m, shares=shares: shares)
        found = list(restoring_findings(RUN, rig))
        assert bool(found) == is_told
        for f in found:
            assert (f.light, f.channel, f.expected, f.unit) == ("red", "spring_end.stiffness", "0", "%")
            assert f.value == pytest.approx(100.0 * (1.0 - 0.548**2))
    monkeypatch.setattr(rig_findings, "residual_shares", lambda m: (0.5, 0.0))
    for known in rig:
        assert not list(restoring_findings(RUN, rig | {known: 1.0}))

    def fails(record):
        raise ValueError("too short")

    monkeypatch.setattr(rig_findings, "motion_from", fails)
    assert not list(restoring_findings(RUN, rig))


RATE = 280.0


def run_of(name, amplitude):
    return rsea.simulate(name, amplitude * np.random.default_rng(4).standard_normal(2800), RATE, seed=4)


def lights_of(findings):
    return {f.channel: f.light for f in findings.of("wrong_rig") if f.light != "green"}


@pytest.mark.parametrize("rig", ["bare_drive", "pendulum"])
def test_a_rig_without_a_spring_is_questioned_on_a_bench_with_one(rig):
    """This check was green."""
    record = record_run(drawn_bench(np.random.default_rng(2)), 4, duration=10.0)
    findings = check_record(record, load_rig(rig))
    (finding,) = (f for f in findings.of("wrong_rig") if f.channel == "spring_end.stiffness")
    assert finding.light == "red"
    assert finding.value == pytest.approx(1530.0, rel=0.1)
    assert finding.remedy == RIGHT_RIG


def test_a_rig_without_gravity_is_questioned_on_a_pendulum_that_swings_far():
    """Its torque follows sin(q), which no frequency response shows; a real pendulum was rated amber."""
    t = np.arange(0.0, 20.0, 1.0 / RATE)
    q = 2.0 * np.sin(1.7 * t) * np.sin(0.31 * t)
    v = np.gradient(q, t)
    torque = 0.15 * np.gradient(v, t) + 0.05 * v + 3.0 * np.sin(q)
    record = Record({"command": Channel(t, torque), "position": Channel(t, q)}, "swing")
    assert [f.light for f in restoring_findings(record, load_rig("bare_drive"))] == ["red"]
    assert list(restoring_findings(record, load_rig("pendulum"))) == []


@pytest.mark.parametrize(("name", "amplitude"), [("bare_drive", 15.0), ("pendulum", 1.0)])
def test_the_right_rig_is_not_questioned(name, amplitude):
    assert lights_of(check_record(run_of(name, amplitude), load_rig(name))) == {}


@pytest.mark.parametrize(("factor", "light"), [(0.144, {}), (0.02, {"spring_end.inertia": "red"})])
def test_a_drive_within_the_coarse_spread_of_its_rig_is_not_questioned(factor, light):
    """A rig that states its inertia to 100 % was the wrong one in red at a seventh of it."""
    rig = load_rig("emps")
    values = {n: factor * rig[n] for n in ("rotor.reflected_inertia", "rotor.reflected_damping")}
    command = 50.0 * np.random.default_rng(4).standard_normal(2800)
    run = rsea.simulate(rig.with_values(values), command, RATE, seed=4)
    assert lights_of(check_record(run, rig)) == light


def test_a_value_that_identify_leaves_to_the_prior_is_undetermined():
    """Without encoder three values have no unique size: the check called them determined."""
    run = run_of("paper_high_impedance", 15.0)
    run = replace(run, channels={n: run[n] for n in ("command", "ft")})
    fit = rsea.identify(run, "paper_high_impedance")
    left = {p.name for p in fit.result.parameters if p.determined == "no" and not p.name.startswith("clock")}
    finding = rsea.check(run, "paper_high_impedance").result.of("identifiability")
    assert {f.channel for f in finding if f.light == "amber"} == left
    assert {"rotor.reflected_inertia", "rotor.reflected_damping", "spring.damping"} <= left


def test_a_value_far_from_the_rigs_is_amber_with_both_numbers():
    """A spring 30 % off was green."""
    bench = load_rig("paper_high_impedance").with_values({"spring.stiffness": 1.3 * 1530.456})
    run = rsea.simulate(bench, 15.0 * np.random.default_rng(4).standard_normal(2800), RATE, seed=4)
    (finding,) = rsea.check(run, "paper_high_impedance").result.of("rig_value")
    assert (finding.light, finding.channel, finding.expected) == (
        "amber",
        "spring.stiffness",
        "1530, to 15 %",
    )
    assert finding.low < 1.3 * 1530.456 < finding.high
    assert rsea.check(run, bench).result.of("rig_value") == ()
