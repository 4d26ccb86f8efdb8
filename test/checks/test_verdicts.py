"""Laws between channels and who is wrong by them: factors, signs and lags are those put in."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.checks.finding import Finding, Findings
from rsea_ros.checks.pairs import Pair, is_held, laws, pairs_of
from rsea_ros.checks.verdicts import factors, in_step, start_of, verdict_findings
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Fault, Record
from rsea_ros.report.check import sentence, warnings

RIG = load_rig("paper_high_impedance")
K, B, J = 1530.456, 23.088 + 3.0, 0.953 + 0.004
"""Table 2: stiffness; damping of drive and spring; inertia of rotor and chassis."""
RATE, DURATION = 280.0, 12.0
STAMPS = np.arange(0.0, DURATION, 1.0 / RATE)
TORQUES = ("motor_torque", "command")
MOTIONS = {(torque, motion) for torque in TORQUES for motion in ("position", "velocity")}


def signals(seed: int = 3) -> dict[str, object]:
    """Return the channels of the paper's machine as functions of time, of sines from 0.3 to 12 Hz."""
    rng = np.random.default_rng(seed)
    w = 2.0 * np.pi * rng.uniform(0.3, 12.0, 60)
    amplitude, phase = 1e-3 * rng.uniform(0.5, 1.0, 60) / np.sqrt(w), rng.uniform(0.0, 6.28, 60)
    response = {"position": 1.0, "velocity": 1j * w, "ft": K, "deflection": 1.0}
    response |= dict.fromkeys(TORQUES, K + 1j * w * B - w**2 * J)
    return {
        name: lambda t, h=h: np.imag(np.exp(1j * (np.outer(t, w) + phase)) @ (amplitude * h))
        for name, h in response.items()
    }


def record_of(y: str, x: str, lag=0.0, factor: float = 1.0, rate: float = RATE) -> Record:
    """Return two channels with a little noise, y late by a lag, which may be a function of time."""
    made, rng, t = signals(), np.random.default_rng(8), np.arange(0.0, DURATION, 1.0 / rate)
    values = factor * made[y](t - (lag(t) if callable(lag) else lag))
    other = made[x](STAMPS)
    noisy = (v + 0.01 * np.std(v) * rng.standard_normal(len(v)) for v in (values, other))
    return Record({n: Channel(at, v) for n, at, v in zip((y, x), (t, STAMPS), noisy, strict=True)})


ALL_SINES = Record({n: Channel(STAMPS, np.sin(STAMPS)) for n in signals()})
BARE = {("velocity", "position"), ("motor_torque", "command")}
SPRUNG = {("velocity", "position"), ("ft", "deflection"), ("motor_torque", "ft")}
OF_FT = {(torque, x) for torque in TORQUES for x in ("ft", "deflection")}
HELD = {("ft", "deflection"), ("deflection", "position"), ("ft", "position"), ("ft", "velocity"), *BARE,
        *MOTIONS, *OF_FT}  # fmt: skip


@pytest.mark.parametrize(
    ("rig", "mechanics", "tied"),
    [
        ("paper_high_impedance", (K, B, J), HELD),
        ("bare_drive", (0.0, 23.088, 0.953 + 0.05), BARE | MOTIONS),
        ("pd_joint", (400.0, 0.5, 0.02), SPRUNG | {("motor_torque", "position")}),
        ("paper_moving_output", (K, 0.0, 0.0), SPRUNG | BARE | {("command", "ft")}),
    ],
)
def test_a_law_holds_for_the_mechanics_of_its_rig(rig, mechanics, tied) -> None:
    found, (k, b, j), s = laws(ALL_SINES, load_rig(rig)), mechanics, 0.7 + 3.0j
    assert {(law.y, law.x) for law in found} == tied and len(found) == len(tied)
    held = rig == "paper_high_impedance"
    assert is_held(load_rig(rig)) == held
    at = {"position": 1.0, "velocity": s, "deflection": 1.0, "ft": k}
    at |= dict.fromkeys(TORQUES, k + b * s + j * s**2)
    stiffness = "spring.stiffness" if held else "spring_end.stiffness"
    inertia = "spring_end.inertia" if rig == "bare_drive" else "rotor.reflected_inertia"
    for law in found:
        assert law.powers == tuple(range(law.powers[0], law.powers[0] + len(law.expected)))
        assert law.inverted == (law.y in TORQUES and law.x not in TORQUES)
        assert law.less == ("ft" if (rig, law.y, law.x) == ("pd_joint", "motor_torque", "position") else "")
        if law.expected == (0.0,):
            continue  # a moving output: of torque and F/T the lag alone counts
        said = sum(c * s**p for c, p in zip(law.expected, law.powers, strict=True)) * at[law.x]
        assert said == pytest.approx(at[law.y] - (at["ft"] if law.less else 0.0), rel=1e-9)
        if law.y in TORQUES and law.x != "ft" and law.x not in TORQUES:
            assert law.names == (stiffness, "rotor.reflected_damping", inertia)[-len(law.names) :]
        else:
            assert law.names[0] == ("spring.stiffness" if law.y == "ft" else "") and not any(law.names[1:])


@pytest.mark.parametrize(
    ("y", "x", "factor", "lag"),
    [("velocity", "position", -2.0, 0.013), ("ft", "deflection", 1.0, 0.013), ("command", "ft", 3.0, 0.013),
     ("motor_torque", "velocity", -1.0, 0.013), ("motor_torque", "position", 0.5, -1.3)],
)  # fmt: skip
def test_a_lag_and_a_factor_are_found(y, x, factor, lag) -> None:
    (pair,) = pairs_of(record_of(y, x, lag, factor), RIG)
    assert (pair.start, pair.stop) == (0.0, STAMPS[-1]) and pair.fits and pair.clear and not pair.unrelated
    assert pair.lag == pytest.approx(lag, abs=0.005) and pair.sign == np.sign(factor)
    assert pair.factor == pytest.approx(abs(factor), rel=0.04)
    assert pair.coherence > 0.97 and pair.left < 0.08
    for ratio, sd, expected in zip(pair.ratios, pair.sds, pair.law.expected, strict=True):
        assert not expected or (0.02 < sd < 0.05 and abs(np.log(ratio / factor)) < 0.05 + 0.15 * (lag < 0.0))


def test_what_is_not_related_says_so() -> None:
    noise = Channel(STAMPS, np.random.default_rng(4).standard_normal(len(STAMPS)))
    (pair,) = pairs_of(record_of("ft", "position").with_channels(ft=noise), RIG)
    assert pair.unrelated and not pair.fits and not pair.ratios and pair.coherence < 0.05


def test_a_lag_and_a_sign_that_change_part_a_record() -> None:
    early, late = (record_of("ft", "position", lag, factor) for lag, factor in ((0.0, 1.0), (0.3, -1.0)))
    ft = Channel(STAMPS, np.where(STAMPS < 6.0, early["ft"].y, late["ft"].y))
    first, last = pairs_of(early.with_channels(ft=ft), RIG)
    assert first.start == 0.0 and 4.5 < first.stop <= 6.0 <= last.start < 7.5 and last.stop == STAMPS[-1]
    assert (first.lag, last.lag) == pytest.approx((0.0, 0.3), abs=0.003)
    assert (first.sign, last.sign) == (1, -1)
    assert (first.factor, last.factor) == pytest.approx((1.0, 1.0), abs=0.01)


def test_a_lag_that_drifts_is_followed() -> None:
    parts = pairs_of(record_of("motor_torque", "command", lambda t: 0.03 * t), RIG)
    assert len(parts) > 6 and parts[0].start == 0.0 and parts[-1].stop > 10.0
    for part in parts:
        assert part.lag == pytest.approx(0.015 * (part.start + part.stop), abs=0.02) and part.sign == 1


@pytest.mark.parametrize(("y", "x", "factor"), [("velocity", "position", -1.0), ("ft", "position", 2.0)])
def test_a_slow_channel_is_compared_with_the_faster_one_at_its_samples(y, x, factor) -> None:
    (pair,) = pairs_of(record_of(y, x, 0.2, factor, rate=8.0), RIG)
    assert (pair.start, pair.stop) == (0.0, 11.875) and pair.fits and pair.clear
    assert pair.lag == pytest.approx(0.2, abs=1.0 / RATE) and pair.coherence + pair.left == pytest.approx(1.0)
    assert (pair.sign * pair.factor, *pair.ratios) == pytest.approx((factor, factor), rel=0.01)


@pytest.mark.parametrize("lost", ["", "ft", "motor_torque"])
def test_an_output_that_something_else_moves_makes_an_ft_of_either_sign(lost) -> None:
    """The motor gives way: its torque is -0.75 of ft at every instant, and nothing is turned."""
    f = np.array([0.4, 0.9, 1.7, 2.9, 5.1])
    phase = 2.0 * np.pi * np.outer(STAMPS, f) + np.array([0.2, 1.4, 2.9, 4.0, 5.5])
    size = np.array([0.3, 0.12, 0.06, 0.02, 0.01])
    q, w = np.sin(phase) @ size, np.cos(phase) @ (2.0 * np.pi * f * size)
    a = -np.sin(phase) @ ((2.0 * np.pi * f) ** 2 * size)
    ft = -(J * a + B * w + 8.0 * np.sign(w)) / 1.75
    noise = np.random.default_rng(5).standard_normal((4, len(STAMPS)))
    made = {"position": q + 1e-5 * noise[0], "deflection": ft / K + 1e-6 * noise[1], "command": -0.75 * ft,
            "ft": ft + 0.02 * noise[2], "motor_torque": -0.75 * ft + 0.02 * noise[3]}  # fmt: skip
    ends = {lost: 0.5 * DURATION}
    record = Record({n: Channel(STAMPS, y).between(0.0, ends.get(n, DURATION)) for n, y in made.items()})
    rig = replace(RIG, motion="measured")
    assert verdict_findings(pairs_of(record, rig), rig, "z") == ([], {})


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


def test_what_results_repeat_is_not_warned_of_but_a_wrong_rig_is_and_first():
    late, dead = Finding("amber", "clock_offset", "ft"), Finding("red", "frozen", "position")
    ratio, noise = Finding("amber", "wrong_rig", "gear.ratio"), Finding("amber", "noise", "ft")
    repeated = tuple(Fault(f.kind, f.channel, 1.0, "") for f in (dead, ratio))
    findings = Findings("run", "rig", (dead, late, noise, ratio), repeated)
    assert warnings(findings) == [sentence(ratio), sentence(late)]
