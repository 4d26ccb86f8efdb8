"""A recommended run: excite plays what was simulated, within the limits of rig and driver."""

import math

import numpy as np
import pytest
from runs import RATE, RIG, command_of, excited

from rsea_ros.diagnosis.next_experiment import (
    EXCITATIONS,
    _as_excited,
    _series,
    _settings,
    allowed_run,
    amplitude_series,
)
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import Solution
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import END_NAMES, EffectSetting
from rsea_ros.model.rig_file import load_rig, packaged_names
from rsea_ros.model.simulation import simulate
from rsea_ros.nodes import driver
from rsea_ros.nodes._devices import limits_of
from rsea_ros.nodes.excite import TABLE
from rsea_ros.records.record import Channel, Record

DEFAULTS = {p.name: p.default for p in driver.TABLE}
EVERY = {f"{o.kind} {o.low:g}-{o.high:g} Hz": (o.kind, _settings(o, RATE)) for o in EXCITATIONS}
CAUSES = {"backlash": {"gap": 3e-3}, "coulomb_friction": {"torque": 0.4}}
LIKE_OTHERS = {"cycloidal", "prototype_knee", "sea_two_encoders", "separate_stiffnesses"}
"""Rigs of the kind of paper_high_impedance, with other numbers."""
PAIRS = [
    (rig, "coulomb_friction" if load_rig(rig).rigid_spring else "backlash")
    for rig in packaged_names()
    if rig not in LIKE_OTHERS
]


SLOW = {"kind": "chirp", "duration": 10.0, "noise": 0.0, "low": 0.1, "high": 5.0}


def like(rig, amplitude=20.0):
    """A case of a run as the bench has it."""
    return case_from(excited(rig, sensors=1, amplitude=amplitude, **SLOW), rig)


def play_run(run, rig):
    """Return what excite would publish, with its defaults for options that the recommendation omits."""
    given = {k: v for k, v in _as_excited(run, rig).items() if k not in ("kind", "unit", "peak")}
    values = {p.name: p.default for p in TABLE}
    names = ("rate", "duration", "amplitude", "noise", "low", "high", "period", "seed")
    return excitation(
        run.kind, ExcitationSettings(**{n: given.get(n, values[n]) for n in names}), values["ramp"]
    )


def move_rig(rig, command):
    """The rig's response, every channel."""
    t = np.arange(len(command)) / RATE
    blank = {n: Channel(t, np.zeros(len(t))) for n in ("position", "velocity", "ft") if rig.measures(n)}
    outputs = simulate(rig, Record({"command": Channel(t, command), **blank}))
    return {n: np.abs(y).max() for n, y in outputs.items()}


def shares(rig, command, travel):
    """Return each limited quantity over its limit, when a rig plays a command. travel: rad, allowed."""
    if rig.loop is not None:
        return {"command": np.abs(command).max() / travel}
    peaks, bounds = move_rig(rig, command), limits_of(DEFAULTS | {"rig": rig.name})
    deflects = rig.clamped == set(END_NAMES) and math.isfinite(bounds.deflection)
    position = bounds.deflection if deflects else travel
    limits = {"velocity": bounds.velocity, "position": position, "ft": bounds.ft}
    found = {name: peaks[name] / limit for name, limit in limits.items() if name in peaks}
    steps = np.abs(np.diff(command, prepend=0.0, append=0.0)).max() * RATE
    return found | {"torque": np.abs(command).max() / bounds.torque, "slew": steps / bounds.slew}


def present(rig):
    """Return the case of a run within the limits: as large as they let a slow chirp be."""
    amplitude = 0.3 if rig.loop is not None else 40.0
    while max(shares(rig, command_of(amplitude=amplitude, **SLOW).y, math.inf).values()) > 1.0:
        amplitude *= 0.5
    return like(rig, amplitude), amplitude


def solution(case, rig):
    """Return a fit without unknowns."""
    return Solution(Problem((case,), rig, (), ("ft",)), np.empty(0), np.empty(0), np.empty((0, 0)), 0.0)


@pytest.mark.parametrize(("name", "cause"), PAIRS)
def test_no_run_exceeds_the_limits(name, cause):
    """102 N m were asked for, and 5 rad/s where 2.4 are driven.

    Every excitation, at one and a half times the present run; the series too.
    """
    rig = load_rig(name)
    rig = rig.with_effects(*(e for e in rig.effects if e.name != cause), EffectSetting(cause, CAUSES[cause]))
    case, amplitude = present(rig)
    if not isinstance(case.drive, Drive):  # it drifts: a run is recommended without numbers
        assert not amplitude_series(solution(case, rig), 40.0, RATE).excitation
        return
    travel = 1.05 * float(np.nanmax(np.abs(case.measured["position"])))
    runs = 0
    for kind, settings in [*EVERY.values(), ("multisine", _series(rig, RATE))]:
        run = allowed_run(rig, case, kind, settings, 1.5 * amplitude)
        if run is None:
            continue
        runs += 1
        found = shares(rig, play_run(run, rig), travel)
        assert max(found.values()) <= 1.0, (kind, settings.low, settings.high, found)
        assert run.peak <= 1.501 * amplitude
    assert runs > 0
    experiment = rig.loop is None and amplitude_series(solution(case, rig), 40.0, RATE)
    if experiment and experiment.excitation:
        run = allowed_run(rig, case, "multisine", _series(rig, RATE), experiment.excitation["peak"])
        assert _as_excited(run, rig)["peak"] == pytest.approx(experiment.excitation["peak"], rel=0.01)


def test_one_limit_is_used_and_not_a_fear_of_it():
    for kind, settings in EVERY.values():
        assert allowed_run(RIG, like(RIG), kind, settings, 102.0).peak > 15.0
    run = allowed_run(RIG, like(RIG), *EVERY["multisine 0.1-5 Hz"], 20.0)
    assert np.abs(play_run(run, RIG)).max() == pytest.approx(20.0, rel=0.01), "within them as requested"


def test_an_impossible_run_is_not_recommended():
    uneven = ExcitationSettings(rate=280.03, duration=12.0, noise=0.0)
    assert allowed_run(RIG, like(RIG), "multisine", uneven, 20.0) is None


@pytest.mark.parametrize(
    ("amplitude", "times_noise", "factor"),
    [(20.0, 40.0, 0.5), (20.0, 1.3, 2.0), (20.0, 1.02, None), (60.0, 1.3, None)],
)
def test_an_amplitude_series_is_printed_only_where_its_residual_would_be_seen(amplitude, times_noise, factor):
    """At 60 N m twice as much is beyond the limits."""
    experiment = amplitude_series(solution(like(RIG, amplitude), RIG), times_noise, RATE)
    assert (experiment is None) == (factor is None)
    if factor:
        assert (experiment.reason, experiment.amplitude) == ("amplitude_series", factor)
        assert experiment.excitation["peak"] == pytest.approx(20.0 * factor, rel=0.01)
