"""Who is wrong, from pairs whose channels' factors, signs and lags are put in."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rsea_ros.checks.pairs import Pair, laws
from rsea_ros.checks.verdicts import factors, in_step, start_of, verdict_findings
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record
from rsea_ros.report.check import sentence

RIG = load_rig("paper_high_impedance")
T = np.arange(100) / 10.0
NAMES = ("command", "motor_torque", "position", "velocity", "ft", "deflection")
EVERY = laws(Record({n: Channel(T, np.sin(T)) for n in NAMES}), RIG)


def pairs(start: float = 0.0, stop: float = 10.0, lag=None, rig=None, left: float = 0.03, **gain: float):
    """Return what every pair of the machine says of channels with gains and lags (s), and a changed rig."""
    lag, made = lag or {}, []
    for law in EVERY:
        ratio = gain.get(law.y, 1.0) / gain.get(law.x, 1.0)
        ratios = tuple(ratio * (rig or {}).get(n, 1.0) if e else 0.0
                       for n, e in zip(law.names, law.expected, strict=True))  # fmt: skip
        made.append(Pair(
            law, start, stop, factor=abs(ratios[0]), sign=int(np.sign(ratios[0])), coherence=0.98,
            ratios=ratios, lag=lag.get(law.y, 0.0) - lag.get(law.x, 0.0), sds=(0.03,) * len(ratios),
            left=left, fits=True, clear=True,
        ))  # fmt: skip
    return made


def told(found):
    return {(f.kind, f.channel, f.light) for f in found}


def test_a_sound_record_has_no_finding() -> None:
    assert verdict_findings(pairs(), RIG, "z") == ([], {})
    gains = {"command": 1.15, "motor_torque": 0.9, "ft": 1.1}
    assert verdict_findings(pairs(lag={"ft": 0.01}, **gains), RIG, "z") == ([], {})


@pytest.mark.parametrize("name", ["velocity", "ft", "position", "deflection"])
def test_a_turned_channel_is_named_with_its_remedy(name: str) -> None:
    for axis, other in (("z", "-z"), ("-x", "x")):
        (found,), late = verdict_findings(pairs(**{name: -1.0}), RIG, axis)
        assert (found.kind, found.channel, found.light, found.value, late) == ("sign", name, "red", -1.0, {})
        said = f"--axis {other}" if name == "ft" else f"`sign: -1` for {name} in the import map"
        assert found.remedy.startswith(said) and found.detail == "turned against the others, which agree"


DEG, TURN, RATIO = 180.0 / math.pi, 2.0 * math.pi, 502.0
UNITS = [
    ("position", DEG, "deg", "`unit: deg`"), ("position", 1e3, "mrad", "`unit: mrad`"),
    ("position", 1.0 / TURN, "rev", "`unit: rev`"), ("position", 60.0 * DEG, "arcmin", "`unit: arcmin`"),
    ("position", RATIO, "rad at the motor", f"`scale: {1 / RATIO:.6g}`"),
    ("velocity", 60.0 / TURN, "rpm", "`unit: rpm`"), ("velocity", DEG, "deg/s", "`unit: deg/s`"),
    ("velocity", RATIO * 60.0 / TURN, "rpm at the motor", f"`scale: {TURN / 60 / RATIO:.6g}`"),
    ("ft", 1e3, "mN m or N mm", "`unit: mN m`"), ("ft", 100.0, "N cm", "`scale: 0.01`"),
    ("ft", 1e-3, "kN m", "`unit: kN m`"), ("ft", 8.8507, "lbf in", "`scale: 0.112985`"),
    ("motor_torque", 1.0 / RATIO, "N m at the motor", "`scale: 502`"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "factor", "meaning", "remedy"), UNITS)
def test_a_unit_is_named_by_its_factor(name, factor, meaning, remedy) -> None:
    assert min(abs(f.value / factor - 1.0) for f in factors(name, RIG)) < 1e-4
    gain = {name: 1.05 * factor}
    (found,), _ = verdict_findings(pairs(**gain), RIG, "z")
    assert (found.kind, found.channel, found.light) == ("scale", name, "red")
    assert found.value == pytest.approx(factor, rel=1e-4) and found.detail.startswith("looks like")
    assert meaning in found.detail
    assert found.remedy.startswith(remedy) and found.expected == "1, SI at the gear output"


def test_a_factor_of_no_unit_is_told_as_measured() -> None:
    (found,), _ = verdict_findings(pairs(ft=31.0), RIG, "z")
    assert found.kind == "scale" and found.value == pytest.approx(31.0, rel=0.05)
    assert "no unit explains it all" in found.detail and found.remedy.startswith("`scale: 0.03")


@pytest.mark.parametrize(("lag", "side"), [(0.2, "late"), (-0.3, "early"), (0.04, "")])
def test_a_late_channel_is_told_from_fifty_milliseconds_on(lag: float, side: str) -> None:
    found, late = verdict_findings(pairs(lag={"ft": lag}), RIG, "z")
    assert told(found) == ({("clock_offset", "ft", "red")} if side else set())
    assert late == pytest.approx({"ft": lag} if side else {}, abs=1e-3)
    for f in found:
        assert f.detail == f"stamped {abs(lag):.3g} s {side} against the others, which agree"
        assert f.remedy.endswith(f"--shift ft={-lag:.4g}") and f.unit == "s"


def test_a_lag_that_grows_and_one_of_a_part_are_told_with_their_times() -> None:
    grown = [p for k in range(4) for p in pairs(2.5 * k, 2.5 * k + 2.5, lag={"ft": 0.1 + 0.1 * k})]
    (found,), late = verdict_findings(grown, RIG, "z")
    assert found.value == pytest.approx(0.25, abs=0.01)
    assert "0.1 s late at 0 s, 0.4 s at 10 s against the others, which agree, growing between" in found.detail
    part = [*pairs(0.0, 6.0), *pairs(6.0, 10.0, ft=-1.0)]
    (found,), late = verdict_findings(part, RIG, "z")
    assert found.kind == "sign" and found.detail.endswith("which agree from 6 s to 10 s") and late == {}


@pytest.mark.parametrize(
    ("name", "factor", "light"),
    [("spring.stiffness", 1.5, None), ("spring.stiffness", 2.5, "amber"), ("spring.stiffness", 5.0, "red"),
     ("spring.stiffness", 0.2, "red"), ("rotor.reflected_inertia", 2.5, "amber"),
     ("rotor.reflected_damping", 3.5, None), ("rotor.reflected_damping", 1e3, "amber")],
)  # fmt: skip
def test_a_value_of_another_machine_is_told(name, factor, light) -> None:
    found, _ = verdict_findings(pairs(rig={name: factor}), RIG, "z")
    mine = [f for f in found if f.channel == name]
    assert [f.light for f in mine] == ([light] if light else [])
    for f in mine:
        assert f.kind == "wrong_rig" and f.value == pytest.approx(factor * RIG[name], rel=0.3)
        assert f.unit == RIG.unit(name)


def test_two_channels_alone_contradict_each_other_and_convict_nobody() -> None:
    two = [p for p in pairs(velocity=-3.5, lag={"velocity": 0.08}) if p.law.y == "velocity"]
    found, late = verdict_findings(two, RIG, "z")
    assert told(found) == {("contradiction", "velocity", "amber")} and late == {}
    (one,) = found
    assert one.value == pytest.approx(-3.5) and one.unit == "1"
    said = "−3.50 times the rate of the position, 80 ms behind it, coherence 0.98, from 0 s to 10 s"
    assert sentence(one).startswith(f"amber: contradiction velocity: {said}; expected 1, in step")


def test_a_fit_begins_with_what_the_pairs_measure() -> None:
    start = start_of(pairs(rig={"spring.stiffness": 1.2}, lag={"command": -0.02}), RIG)
    assert start.values["spring.stiffness"] == pytest.approx(1.2 * 1530.456)
    assert start.values["rotor.reflected_inertia"] == pytest.approx(0.953)
    assert set(start.delay.values()) == {0.02}
    run = Record({n: Channel(T, T) for n in ("command", "ft")})
    moved = in_step(run, {"ft": 0.5})
    assert moved["ft"].t[0] == pytest.approx(0.0, abs=1e-9) and moved["command"].t[-1] <= 9.4 + 1e-9
    assert moved["ft"].y[0] == pytest.approx(0.5)
