"""A recommended run: excite plays what was simulated, within the limits of rig and driver."""

import numpy as np
import pytest

from rsea_ros.diagnosis.next_experiment import (
    EXCITATIONS,
    DriverLimits,
    _as_excited,
    _series,
    _settings,
    allowed_run,
    amplitude_series,
)
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.problem import Problem, case_from
from rsea_ros.identification.solver import Solution
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.nodes._device_parameters import LIMITS
from rsea_ros.nodes.excite import TABLE
from rsea_ros.records.record import Channel, Record

RATE = 280.0
DRIVER = DriverLimits()
EVERY = {f"{o.kind} {o.low:g}-{o.high:g} Hz": (o.kind, _settings(o, RATE)) for o in EXCITATIONS}
EVERY["series"] = ("multisine", _series(load_rig("paper_high_impedance"), RATE))


def like(rig, amplitude=20.0):
    """A case of a run as the bench has it."""
    slow = ExcitationSettings(rate=RATE, duration=10.0, amplitude=amplitude, noise=0.0, low=0.1, high=5.0)
    command = excitation("chirp", slow)
    return case_from(synthesize(rig, Channel(np.arange(len(command)) / RATE, command), seed=1), rig)


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


def test_the_limits_are_the_drivers_defaults():
    driver = {p.name.removesuffix("_limit"): p.default for p in LIMITS}
    stated = {n: v for n, v in vars(DRIVER).items() if driver[n] != -1.0}  # the others are derived
    assert {n: driver[n] for n in stated} == stated and set(stated) == {"slew", "power"}
    assert next(p.default for p in TABLE if p.name == "limit") == DRIVER.torque


@pytest.mark.parametrize("name", EVERY)
def test_no_run_exceeds_the_limits_of_rig_and_driver(name):
    """102 N m were asked for, half as much again as a present run at the driver's limit."""
    rig = load_rig("paper_high_impedance")
    run = allowed_run(rig, like(rig), *EVERY[name], 102.0)
    command = play_run(run, rig)
    assert np.abs(command).max() <= DRIVER.torque
    assert np.abs(np.diff(command)).max() * RATE <= DRIVER.slew
    peaks = move_rig(rig, command)
    assert peaks["position"] <= DRIVER.deflection and peaks["ft"] <= DRIVER.ft
    assert peaks["velocity"] <= DRIVER.velocity
    assert run.peak > 15.0, "one limit is used, not a fear of it"


def test_a_free_end_travels_no_further_than_it_did():
    rig = load_rig("paper_moving_output")
    case = like(rig, 2.0)
    run = allowed_run(rig, case, *EVERY["steps 0.1-10 Hz"], 3.0)
    assert run.peak < 2.9
    assert move_rig(rig, play_run(run, rig))["position"] <= 1.05 * np.abs(case.measured["position"]).max()


def test_a_command_within_the_limits_is_played_as_requested():
    rig = load_rig("paper_high_impedance")
    run = allowed_run(rig, like(rig), *EVERY["multisine 0.1-5 Hz"], 20.0)
    assert np.abs(play_run(run, rig)).max() == pytest.approx(20.0, rel=0.01)


def test_an_impossible_run_is_not_recommended():
    rig = load_rig("paper_high_impedance")
    uneven = ExcitationSettings(rate=280.03, duration=12.0, noise=0.0)
    assert allowed_run(rig, like(rig), "multisine", uneven, 20.0) is None


@pytest.mark.parametrize(
    ("times_noise", "factor"), [(40.0, 0.5), (1.3, 2.0), (1.02, None)]
)
def test_an_amplitude_series_is_printed_only_where_its_residual_would_be_seen(times_noise, factor):
    rig = load_rig("paper_high_impedance")
    problem = Problem((like(rig),), rig, (), ("ft",))
    solution = Solution(problem, np.empty(0), np.empty(0), np.empty((0, 0)), 0.0)
    experiment = amplitude_series(solution, times_noise, RATE)
    assert (experiment is None) == (factor is None)
    if factor:
        assert (experiment.reason, experiment.amplitude) == ("amplitude_series", factor)
        assert experiment.excitation["peak"] == pytest.approx(20.0 * factor, rel=0.01)


def test_twice_an_amplitude_at_the_limit_is_not_printed():
    rig = load_rig("paper_high_impedance")
    problem = Problem((like(rig, 60.0),), rig, (), ("ft",))
    solution = Solution(problem, np.empty(0), np.empty(0), np.empty((0, 0)), 0.0)
    assert amplitude_series(solution, 1.3, RATE) is None
