"""Sign, scale and smoothing are reported with their remedy; effects and strangers' rigs raise no alarm."""

import functools

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.hidden import hide
from independent.severities import drawn_parameters
from runs import FREE, free_run

import rsea_ros as rsea
from rsea_ros.checks.check import check_record
from rsea_ros.checks.signal_findings import _average
from rsea_ros.checks.stamp_findings import rates
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel

RIG = load_rig("paper_high_impedance")


@functools.cache
def good():
    return record_run(drawn_bench(np.random.default_rng(2)), 4, duration=8.0)


def scale_channels(record, **factors):
    return record.with_channels(**{n: Channel(record[n].t, f * record[n].y) for n, f in factors.items()})


def red_findings(findings, *kinds):
    return {(f.kind, f.channel) for f in findings.findings if f.light == "red" and f.kind in kinds}


@pytest.mark.parametrize(
    ("channel", "factor", "meaning"),
    [
        ("command", -1.0, "turned"),
        ("ft", -1.0, "turned"),
        ("position", -1.0, "turned"),
        ("ft", 1e3, "mN m or N mm"),
        ("motor_torque", 1 / 502, "at the motor"),
        ("position", 1 / 1.2518225e-5, "counts"),
        ("velocity", 502 * 9.549297, "rpm at the motor"),
    ],
)
def test_a_turned_channel_or_another_unit_is_a_fault_of_the_record(channel, factor, meaning):
    """Every unit has its name in test_verdicts."""
    findings = check_record(scale_channels(good(), **{channel: factor}), RIG)
    kind = "sign" if factor < 0.0 else "scale"
    assert red_findings(findings, "sign", "scale", "wrong_rig") == {(kind, channel)}
    (result,) = (f for f in findings.of(kind) if f.light == "red")
    assert result.value == pytest.approx(factor, rel=0.01) and meaning in result.detail
    assert (kind, channel) in {(f.kind, f.channel) for f in findings.faults}


def test_drive_values_on_the_motor_side_are_reported_together():
    findings = check_record(scale_channels(good(), command=1 / 502, motor_torque=1 / 502), RIG)
    assert red_findings(findings, "scale") == {("scale", "command"), ("scale", "motor_torque")}


LIKE_ANOTHER_UNIT = (
    None, "torque_constant_error", "torque_saturation", "gear_compliance", "hard_stop",
    "structural_resonance",
)  # fmt: skip
"""Of the catalogue: what changes a size, a stiffness or a phase most."""


@pytest.mark.parametrize("effect", LIKE_ANOTHER_UNIT)
def test_an_effect_is_not_taken_for_a_wrong_unit_or_rig(effect):
    rng = np.random.default_rng(1)
    bench = drawn_bench(rng)
    bench = hide(bench, effect, drawn_parameters(effect, "strong", rng)) if effect else bench
    findings = check_record(record_run(bench, 3, duration=5.0), RIG)
    assert findings.light != "red"
    assert not {f.kind for f in findings.faults} & {"sign", "scale", "wrong_rig", "dead_channel"}


def test_a_wrong_inertia_is_not_taken_for_a_scale():
    rig = RIG.with_values({"rotor.reflected_inertia": 2.0 * RIG["rotor.reflected_inertia"]})
    findings = check_record(good(), rig)
    assert findings.light != "red"
    (result,) = (f for f in findings.of("wrong_rig") if f.light != "green")
    assert result.channel == "rotor.reflected_inertia"


@pytest.mark.parametrize(("name", "light"), [("prototype_knee", "amber"), ("cycloidal", "red")])
def test_another_rig_is_asked_about(name, light):
    """In red where pairs measure its values; a simulation that does not fit alone is no more than amber."""
    findings = check_record(good(), load_rig(name))
    assert light in {f.light for f in findings.of("wrong_rig")}
    assert findings.rig_name == name


@pytest.mark.parametrize(
    ("names", "samples", "centred"), [(("ft",), 5, False), (("position", "velocity"), 9, True)]
)
def test_an_averaged_sensor_is_named_with_its_length(names, samples, centred):
    """Only the F/T channel was tried: an averaged encoder gave a stiffness without a word of why."""
    window, before = np.ones(samples) / samples, samples // 2 if centred else samples - 1
    averaged = {
        n: Channel(c.t, np.convolve(np.pad(c.y, (before, samples - 1 - before), "edge"), window, "valid"))
        for n in names
        for c in [good()[n]]
    }
    findings = check_record(good().with_channels(**averaged), RIG)
    assert {f.channel for f in findings.of("smoothing")} == set(names)
    assert all(f"average of {samples} samples" in f.detail for f in findings.of("smoothing"))


@pytest.mark.parametrize(
    ("effect", "parameters"), [("ft_sensor_lag", {"time_constant": 5e-3}), ("command_delay", {"delay": 8e-3})]
)
def test_a_lag_of_sensor_or_drive_is_not_taken_for_a_moving_average(effect, parameters):
    bench = hide(drawn_bench(np.random.default_rng(1)), effect, parameters)
    assert check_record(record_run(bench, 3, duration=8.0), RIG).of("smoothing") == ()


def test_amperes_are_reported_with_the_measured_factor_not_that_of_a_unit_near_it():
    findings = check_record(scale_channels(good(), command=1 / 6.826), RIG)
    (result,) = (f for f in findings.of("scale") if f.light == "red")
    assert result.channel == "command"
    assert result.value == pytest.approx(1 / 6.826, rel=0.1)
    assert "no unit" in result.detail
    assert float(result.remedy.split()[1].rstrip("`")) == pytest.approx(6.826, rel=0.1)


PERIOD = 1.0 / 280.0


def mode(f, frequency, participation, damping=0.03):
    """Response of a sensor without a mode over that of one with it."""
    rise = f**2 / (frequency**2 - f**2 + 2j * damping * frequency * f)
    return 1.0 / (1.0 + participation * rise)


@pytest.mark.parametrize(
    ("frequency", "participation", "highest"),
    [(33.0, 0.6, 20.8), (33.0, 0.6, 24.1), (33.0, 0.3, 28.0), (60.0, 1.0, 40.0), (90.0, 1.5, 60.0)],
)
def test_a_mode_at_the_other_sensor_is_no_average(frequency, participation, highest):
    """A sound velocity beside an F/T sensor with a mode at 33 Hz was called an average of 7 samples."""
    f = np.linspace(0.5, highest, 29)
    response = 3.0 * mode(f, frequency, participation)
    assert _average(f, response, np.full(29, 0.02), PERIOD) == (1, False)


JUDGED = ("sign", "scale", "dead_channel", "frozen_samples", "clock_offset", "contradiction")


@functools.cache
def run():
    return rsea.simulate(RIG, 15.0 * np.random.default_rng(1).standard_normal(2800), 280.0, seed=2)


def late(lag):
    """Return the run with an F/T torque read later than its stamps, by a function of the time, s."""
    ft = run()["ft"]
    return run().with_channels(ft=Channel(ft.t, np.interp(ft.t - lag(ft.t), ft.t, ft.y)))


def said(record, rig=RIG):
    return [f for f in check_record(record, rig).findings if f.light != "green" and f.kind in JUDGED]


def test_a_lag_in_the_second_half_only_is_told_from_when_to_when():
    """It was all green."""
    (finding,) = said(late(lambda t: np.where(t > 5.0, 0.5, 0.0)))
    assert (finding.kind, finding.channel, finding.light) == ("clock_offset", "ft", "red")
    assert finding.value == pytest.approx(0.5, abs=0.01)
    assert "from 5" in finding.detail and "--shift" not in finding.remedy


def test_a_lag_or_a_unit_is_told_once_not_again_as_a_jump_or_coarse_steps():
    """A position that was late from 5 s on was also an encoder that began to count anew, in red."""
    q = run()["position"]
    held = Channel(q.t, np.interp(q.t - np.where(q.t > 5.0, 0.3, 0.0), q.t, q.y))
    found = {(f.kind, f.channel) for f in check_record(run().with_channels(position=held), RIG).findings}
    assert ("clock_offset", "position") in found and ("angle_jumps", "position") not in found
    degrees = check_record(run().with_channels(position=Channel(q.t, np.degrees(q.y))), RIG)
    assert degrees.of("scale") and not degrees.of("coarse_steps")
    assert not any(f.kind == "coarse_steps" for f in degrees.faults)


def test_a_rate_below_a_mode_that_the_command_never_excites_is_no_red_light():
    """A stiff coupling's mode at 689 Hz made every channel of a sound 100 Hz log red."""
    lights = {f.light for top in (5.0, 140.0) for f in rates(slow(), RIG, top) if f.channel == "ft"}
    assert lights == {"amber", "red"}


def slow():
    """Return the run with every twelfth sample, below four to a cycle of the rig."""
    return run().with_channels(**{n: Channel(c.t[::12], c.y[::12]) for n, c in run().channels.items()})


def test_a_lag_that_grows_is_no_dead_channel():
    """A socket's buffer that fills was a dead channel: check the cable."""
    (finding,) = said(late(lambda t: 0.03 * t))
    assert (finding.kind, finding.channel) == ("clock_offset", "ft")
    assert "growing" in finding.detail


def test_turns_on_two_channels_are_one_factor():
    """The model fitted: stiffness, inertia and damping, each six times off."""
    turns = {n: Channel(run()[n].t, run()[n].y / (2.0 * np.pi)) for n in ("position", "velocity")}
    found = said(run().with_channels(**turns))
    assert [(f.kind, f.channel, f.detail) for f in found] == [
        ("scale", "position", "looks like rev"),
        ("scale", "velocity", "looks like rev/s"),
    ]


@pytest.mark.parametrize(
    "factors",
    [
        {"rotor.reflected_inertia": 8.0, "rotor.reflected_damping": 5.0},
        {"spring.stiffness": 6.0, "rotor.reflected_damping": 0.2},
    ],
)
def test_a_stranger_s_rig_convicts_no_channel(factors):
    """Simulated with a rig that does not fit, sound sensors came 0.1 s early or had another clock."""
    rig = RIG.with_values({n: f * RIG[n] for n, f in factors.items()})
    assert said(run(), rig) == []
    assert {f.channel for f in check_record(run(), rig).of("wrong_rig") if f.light != "green"} <= set(factors)


def test_two_channels_alone_show_their_contradiction_and_convict_none():
    velocity = Channel(run()["velocity"].t, 3.4 * run()["velocity"].y)
    two = {n: c for n, c in run().channels.items() if n in ("command", "position")}
    noise = np.random.default_rng(3).standard_normal(len(run()["command"]))
    record = run().with_channels(velocity=velocity, command=Channel(run()["command"].t, noise))
    record = type(record)({n: record[n] for n in (*two, "velocity")})
    (finding,) = (f for f in said(record) if f.kind in ("contradiction", "scale", "sign"))
    assert (finding.kind, finding.light) == ("contradiction", "amber")
    assert finding.value == pytest.approx(3.4, rel=0.1)


HEAVY = FREE.with_values({"rotor.reflected_inertia": 0.953, "spring_end.inertia": 3.0})


@pytest.mark.parametrize(
    ("change", "wrong"),
    [
        (lambda c: {}, []),
        (lambda c: {"ft": Channel(c["ft"].t, -c["ft"].y)}, [("sign", "ft")]),
        (lambda c: {"ft": Channel(c["ft"].t + 0.12, c["ft"].y)}, [("clock_offset", "ft")]),
        (lambda c: {"ft": Channel(c["ft"].t, 1e3 * c["ft"].y)}, [("scale", "ft")]),
        (
            lambda c: {n: Channel(c[n].t, -c[n].y) for n in ("position", "velocity")},
            [("sign", "position"), ("sign", "velocity")],
        ),
    ],
)
def test_where_the_output_moves_two_torques_and_a_motion_tell_which_is_wrong(change, wrong):
    """All of these were green, or an encoder's delay."""
    found = said(free_run().with_channels(**change(free_run().channels)), FREE)
    assert sorted((f.kind, f.channel) for f in found) == wrong
    assert all(f.light == "red" for f in found)
    if wrong == [("clock_offset", "ft")]:
        assert found[0].value == pytest.approx(0.12, abs=0.005)


@pytest.mark.parametrize(("rig", "run_of"), [(RIG, run), (FREE, free_run)])
def test_what_a_drive_reports_on_its_own_side_of_the_gear_is_one_factor(rig, run_of):
    """Three red lines, one of them of the F/T sensor, which alone was right."""
    by = {"position": 50.0, "velocity": 50.0, "command": 0.02, "motor_torque": 0.02}
    record = scale_channels(run_of(), **by)
    other = check_record(record, rig).findings
    (gear,) = (f for f in other if f.channel == "gear.ratio")
    assert gear.light == "amber" and gear.value == pytest.approx(50.0, rel=0.1)
    assert not any(f.light == "red" for f in other)
    stated = rig.with_values({"gear.ratio": 50.0})
    assert {(f.kind, f.channel) for f in said(record, stated)} == {("scale", n) for n in by}


def test_a_motor_torque_that_is_not_its_command_is_told():
    """It was green, and the model fitted; intervals were withheld without a word."""
    torque = run()["motor_torque"]
    wrong = run().with_channels(motor_torque=Channel(torque.t, 2.5 * torque.y))
    (finding,) = said(wrong)
    assert (finding.kind, finding.channel, finding.light) == ("contradiction", "motor_torque", "amber")
    assert finding.value == pytest.approx(2.5, rel=0.1)
    assert rsea.identify(wrong, RIG).verdict == "misfit"


def test_a_torque_of_which_a_heavy_load_lets_little_through_is_not_dead():
    """An F/T sensor that was turned was dead, and so was a velocity beside a dead position."""
    record = free_run(HEAVY)
    assert not check_record(scale_channels(record, ft=-1.0), HEAVY).of("dead_channel")
    q = record["position"]
    noise = Channel(q.t, 1e-5 * np.random.default_rng(3).standard_normal(len(q)))
    (dead,) = check_record(record.with_channels(position=noise), HEAVY).of("dead_channel")
    assert dead.channel == "position"
