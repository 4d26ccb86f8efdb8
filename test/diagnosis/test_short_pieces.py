"""Short pieces of a record: the right model leaves only noise in each of them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from runs import RATE, RIG, command_of, excited, only

from rsea_ros.diagnosis.candidate import with_doubled_step
from rsea_ros.diagnosis.data_split import short_pieces_of
from rsea_ros.identification.problem import Problem, case_from, with_unknown_start
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import measure, simulate, synthesize
from rsea_ros.records.record import MEASURED, Channel, Record


def with_stated_noise(case, rig):
    sensors = {n: rig.sensors[n] for n in case.noise}
    noise = {n: math.hypot(s.noise, s.quantum / math.sqrt(12.0)) for n, s in sensors.items()}
    return replace(case, noise=noise)


def costs_one(problem):
    """Whether the residual of a problem without unknowns is noise: one for each sample."""
    residual = problem.residual(np.zeros(0))
    return float(residual @ residual) == pytest.approx(len(residual), rel=0.1)


@pytest.mark.parametrize("jitter", [0.0, 0.1], ids=["on_the_grid", "jittered"])
@pytest.mark.parametrize(("rate", "velocity"), [(250.0, True), (1000.0, True), (1000.0, False)])
def test_the_true_model_costs_one_for_each_sample_of_its_pieces_on_longer_steps_too(rate, velocity, jitter):
    """Pieces that began within a hold had a motor torque off by a change of the command: 2.5e7 for 2.5e4.

    Without a measured velocity they began at rest: a hundred times the samples.
    """
    rig = RIG
    if not velocity:  # and a motion that fades slowly: half of it is left after the run-up
        rig = rig.with_values({"rotor.reflected_damping": 2.0})
    command = command_of(rate=rate, duration=32.0, seed=5)
    stamps = command.t + jitter / rate * np.random.default_rng(5).uniform(-0.5, 0.5, len(command))
    record = synthesize(rig, Channel(stamps, command.y), seed=5)
    if not velocity:
        record = only(record, "ft", "position", "motor_torque")
    case = with_stated_noise(case_from(record, rig), rig)
    pieces = short_pieces_of(case, Problem((case,), rig, (), MEASURED).outputs(np.zeros(0))[0])
    assert len(pieces) > 5
    problem = Problem(pieces, rig, (), MEASURED)
    assert costs_one(problem) and costs_one(with_doubled_step(problem))


@pytest.mark.parametrize("jitter", [0.0, 0.1], ids=["on_the_grid", "jittered"])
@pytest.mark.parametrize(("times", "kept"), [(0.2, 0.2), (1.5, 1.5), (4.0, 1.0)])
def test_pieces_sample_a_channel_about_as_often_as_commands_at_most(times, kept, jitter):
    """Joint states at four times the rate of the commands took twice as long and added no information."""
    rig, command = RIG, command_of(duration=40.0, seed=5)
    t = command.t
    stamps = (np.arange(round(40.0 * RATE * times)) + 1.0) / (RATE * times)
    stamps += jitter / (RATE * times) * np.random.default_rng(5).uniform(-0.5, 0.5, len(stamps))
    blank = Channel(stamps, np.zeros(len(stamps)))
    asked = Record({"command": command, "ft": Channel(t + 1.0 / RATE, np.zeros(len(t))), "position": blank})
    rng = np.random.default_rng(5)
    measured = {n: measure(rig, n, y, rng) for n, y in simulate(rig, asked).items()}
    record = asked.with_channels(**{n: Channel(asked[n].t, y) for n, y in measured.items()})
    case = with_stated_noise(case_from(record, rig), rig)
    outputs = Problem((case,), rig, (), MEASURED).outputs(np.zeros(0))[0]
    pieces = Problem(short_pieces_of(case, outputs), rig, (), MEASURED)
    counts = {n: sum(np.count_nonzero(p.mask[n]) for p in pieces.cases) for n in ("ft", "position")}
    assert counts["position"] == pytest.approx(kept * counts["ft"], rel=0.02)
    assert costs_one(pieces)


def test_pieces_of_a_load_that_swings_cost_one_whatever_the_current_model_and_the_spring_sensor_say():
    """Nothing told how the load moved where a piece began: the true model cost 2800 times the samples."""
    swings = {"spring_end.inertia": 1.1, "spring_end.gravity": 14.0, "spring_end.damping": 0.5}
    rig = load_rig("paper_moving_output").with_values(swings)
    true = rig.with_effect("ft_gain_error", gain=1.15)
    record = excited(true, sensors=5, rate=250.0, duration=32.0, seed=5)
    case = with_stated_noise(case_from(record, rig), rig)
    wrong = rig.with_values({"spring_end.inertia": 1.4})
    pieces = short_pieces_of(case, Problem((case,), wrong, (), MEASURED).outputs(np.zeros(0))[0])
    assert costs_one(with_unknown_start(Problem(pieces, true, (), MEASURED), np.zeros(0)))
