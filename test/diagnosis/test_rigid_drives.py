"""Drives and joints without a spring: the torque that they lack, and its ripple over the rotor."""

from dataclasses import replace

import numpy as np
import pytest
from runs import command_of, trying

from rsea_ros import simulate
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.initial_guess import ripples, torque_along
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.effects.signal_table import Port
from rsea_ros.identification.problem import case_from
from rsea_ros.model.inverse import motion_from, torques_along
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record


def test_the_missing_torque_of_a_rigid_joint_is_that_of_rotor_link_and_loop():
    """A diagnosis from targets and encoder ended in a traceback: zero motion times an infinite stiffness."""
    rig = load_rig("pd_joint")
    kept = {n: q for n, q in rig.quantities.items() if not n.startswith(("spring.", "chassis."))}
    rigid = replace(rig, quantities=kept, rigid_spring=True)
    t = np.arange(800) / 100.0
    record = synthesize(rigid, Channel(t, 0.5 * np.sin(2.0 * t)), seed=1)
    case = case_from(Record({n: record[n] for n in ("reference", "position")}), rigid)
    error = 1e-3 * np.sin(5.0 * case.t["position"])
    _, torque = torque_along(case, rigid, {"position": case.measured["position"] - error})
    inertia = rigid["rotor.reflected_inertia"] + rigid["spring_end.inertia"]
    stiffness = rigid["controller.k_p"] - inertia * 5.0**2
    damping = rigid["rotor.reflected_damping"] + rigid["controller.k_d"]
    reaction = 1e-3 * np.hypot(stiffness, damping * 5.0)
    assert np.max(np.abs(torque[200:])) == pytest.approx(reaction, rel=0.04)


def cogging_record(seed):
    """Return a drive with cogging, and a record of 15 s: it shows only where the drive is nearly at rest."""
    rig = load_rig("bare_drive")
    ripple = {"amplitude": 3.0, "cycles_per_revolution": 7.0, "phase": 0.4}
    noise = np.random.default_rng(seed).standard_normal(3000)
    command = np.convolve(60.0 * noise, np.ones(40) / 40.0, "same")
    return rig, simulate(rig.with_effect("torque_ripple", **ripple), command, rate=200.0)


@pytest.mark.parametrize("seed", (1, 5))
def test_cogging_is_guessed_as_sharply_as_the_travel_resolves(seed):
    """Lines of 1/8 cycle were a hundredth off: a whole period over a hundred turns, and no fit found it."""
    rig, record = cogging_record(seed)
    case = case_from(record, rig)
    travel = np.ptp(record["position"].y) * rig["gear.ratio"]
    first = ripples(case, rig, torques_along(rig, case.drive))[0]
    assert abs(first["cycles_per_revolution"] - 7.0) * travel < 0.25 * 2.0 * np.pi
    assert first["phase"] == pytest.approx(0.4, abs=0.8)


def test_cogging_of_a_bare_drive_is_named():
    """No effect explained it: only a sensor behind a spring gave the ripple a place to begin at."""
    rig, record = cogging_record(seed=5)
    of_a_spring = {e.name for e in catalogue().values() if e.port is Port.SPRING}
    tried = of_a_spring | {"torque_ripple", "coulomb_friction", "stribeck_friction"}
    diagnosis = diagnose([record], rig, settings=trying(*tried))
    (cause,) = diagnosis.causes
    assert cause.name == "torque_ripple"
    assert cause.parameters["amplitude"].value == pytest.approx(3.0, abs=0.3)
    assert cause.parameters["cycles_per_revolution"].value == pytest.approx(7.0, rel=1e-3)
    assert not of_a_spring & {r.name for r in diagnosis.rejected}, "an effect without a place was tried"


def test_no_effect_reads_the_torque_by_which_it_is_judged():
    """Friction of the measured torque took its noise away: any other measurement gives the same model."""
    rig, t = load_rig("pendulum"), np.arange(2800) / 280.0
    angle, noise = 0.4 * np.sin(np.pi * t), np.random.default_rng(0).standard_normal(len(t))
    channels = {"command": 0.0 * t, "position": angle, "motor_torque": noise}
    motion = motion_from(Record({name: Channel(t, y) for name, y in channels.items()}))
    other = replace(motion, torque=motion.torque[::-1])
    for effect in (e for e in catalogue().values() if e.port not in (Port.SPRING, Port.STRUCTURE)):
        loaded = rig.with_effect(effect.name)
        taken, of_other = (torques_along(loaded, m)["motor_torque"] for m in (motion, other))
        assert np.array_equal(taken, of_other), effect.name


def test_the_torque_of_a_pendulum_that_turns_over_is_filtered_like_its_measurement():
    """The sine of a filtered angle has lines above the filter: 0.088 N m of 5.7 were left, without noise."""
    rig = load_rig("pendulum")
    command = command_of("chirp", duration=20.0, amplitude=10.0, noise=2.0)
    case = case_from(synthesize(rig, command, noise=False), rig)
    left = case.measured["motor_torque"] - torques_along(rig, case.drive)["motor_torque"]
    keep = case.mask["motor_torque"]
    assert np.std(left[keep]) < 2e-3 * np.std(case.measured["motor_torque"][keep])
