"""Recommended runs of every ready rig, with several causes, stay within the limits of rig and driver."""

import math

import numpy as np
import pytest

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
from rsea_ros.model.rig_file import load_rig, rig_names
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel
from test.diagnosis.test_next_experiment import DRIVER, RATE, move_rig, play_run

OPTIONS = {(o.kind, o.low, o.high): (o.kind, _settings(o, RATE)) for o in EXCITATIONS}
CAUSES = {
    "backlash": {"gap": 3e-3},
    "command_delay": {"delay": 4e-3},
    "coulomb_friction": {"torque": 0.4},
    "nonlinear_spring": {"cubic": -20.0},
}
OF_A_SPRING = ("backlash", "nonlinear_spring")
PAIRS = [
    (rig, cause)
    for rig in rig_names()
    for cause in CAUSES
    if not (cause in OF_A_SPRING and load_rig(rig).rigid_spring)
]


def bench(name, cause):
    """Return a rig with one cause, besides what it has already."""
    rig = load_rig(name)
    kept = [e for e in rig.effects if e.name != cause]
    return rig.with_effects(*kept, EffectSetting(cause, CAUSES[cause]))


def shares(rig, command, travel):
    """Return each limited quantity over its limit, when a rig plays a command. travel: rad, allowed."""
    if rig.loop is not None:
        return {"command": np.abs(command).max() / travel}
    peaks = move_rig(rig, command)
    deflection = DRIVER.deflection * (1.0 if rig.rigid_spring else rig["spring.stiffness"])
    limits = {"velocity": DRIVER.velocity, "position": travel}
    if not rig.rigid_spring:
        limits["ft"] = min(DRIVER.ft, deflection) if rig.clamped != set(END_NAMES) else DRIVER.ft
    if rig.clamped == set(END_NAMES):
        limits["position"] = DRIVER.deflection
    found = {name: peaks[name] / limit for name, limit in limits.items()}
    steps = np.abs(np.diff(command, prepend=0.0, append=0.0)).max() * RATE
    return found | {"torque": np.abs(command).max() / DRIVER.torque, "slew": steps / DRIVER.slew}


def present(rig):
    """Return the case of a run within the limits: as large as they let a slow chirp be."""
    amplitude = 0.3 if rig.loop is not None else 40.0
    while True:
        slow = ExcitationSettings(
            rate=RATE, duration=10.0, amplitude=amplitude, noise=0.0, low=0.1, high=5.0
        )
        command = excitation("chirp", slow)
        if max(shares(rig, command, math.inf).values()) <= 1.0:
            record = synthesize(rig, Channel(np.arange(len(command)) / RATE, command), seed=1)
            return case_from(record, rig), amplitude
        amplitude *= 0.5


def solution(case, rig):
    """Return a fit without unknowns."""
    return Solution(Problem((case,), rig, (), ("ft",)), np.empty(0), np.empty(0), np.empty((0, 0)), 0.0)


@pytest.mark.parametrize(("name", "cause"), PAIRS)
def test_no_run_exceeds_the_limits(name, cause):
    """Every excitation, asked for at one and a half times the present run and at half of it."""
    rig = bench(name, cause)
    case, amplitude = present(rig)
    if not isinstance(case.drive, Drive):  # it drifts: a run is recommended without numbers
        assert not amplitude_series(solution(case, rig), 40.0, RATE).excitation
        return
    travel = 1.05 * float(np.nanmax(np.abs(case.measured["position"])))
    runs = 0
    for kind, settings in [*OPTIONS.values(), ("multisine", _series(rig, RATE))]:
        for factor in (0.5, 1.5):
            run = allowed_run(rig, case, kind, settings, factor * amplitude)
            if run is None:
                continue
            runs += 1
            found = shares(rig, play_run(run, rig), travel)
            assert max(found.values()) <= 1.0, (kind, settings.low, settings.high, factor, found)
            assert run.peak <= 1.001 * factor * amplitude
    assert runs > 0


@pytest.mark.parametrize("name", [n for n in rig_names() if load_rig(n).loop is None])
def test_a_series_is_printed_only_with_a_peak_that_the_rig_may_play(name):
    rig = bench(name, "coulomb_friction")
    case, _ = present(rig)
    for times_noise in (1.01, 1.3, 40.0):
        experiment = amplitude_series(solution(case, rig), times_noise, RATE)
        assert experiment is None or times_noise > 1.1
        if experiment is None or not experiment.excitation:
            continue
        run = allowed_run(
            rig, case, "multisine", _series(rig, RATE), experiment.excitation["peak"]
        )
        assert _as_excited(run, rig)["peak"] == pytest.approx(experiment.excitation["peak"], rel=0.01)
