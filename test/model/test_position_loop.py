"""Joints commanded by positions: the loop in the simulated step, against scipy and against its purpose."""

from dataclasses import replace

import numpy as np
import pytest
import slow

from rsea_ros.errors import ChannelError, RigError
from rsea_ros.identification.frequency_response import model_response
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.rig import Quantity
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_file import load_rig, rig_to_document
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.records.record import Channel, Record

RATE = 200.0
T = np.arange(400) / RATE
PD, STIFF = {"k_p": 60.0, "k_d": 2.0}, {"value": 60.0, "unit": "N m/rad"}
STEPPING = np.where(T < 0.5, 0.0, np.where(T < 1.2, 0.3, -0.2))


def joint(kind="pd", **values):
    """Return a rigid joint in a position loop."""
    gains = {"p": {"k_p": 60.0}, "mit": PD, "pd": PD, "cascade": {"k_pos": 8.0, "k_v": 6.0}}[kind]
    rig = load_rig("bare_drive").with_values(
        {"rotor.reflected_inertia": 0.05, "rotor.reflected_damping": 0.8, "spring_end.inertia": 0.03}
    )
    quantities = {**rig.quantities, **{f"controller.{n}": Quantity(v) for n, v in gains.items()}}
    rig = replace(rig, loop=kind, quantities=quantities)
    return rig.with_values({f"controller.{n}": v for n, v in values.items()})


def move_rig(rig, targets=STEPPING, **options):
    """Return what a rig does for targets, at the end of each hold."""
    blank = {n: Channel(T + 1 / RATE, np.zeros(len(T))) for n in ("position", "velocity", "motor_torque")}
    return simulate(rig, Record({"reference": Channel(T, targets), **blank}, source="joint"), **options)


def by_scipy(rig, law, targets=STEPPING):
    """Return the position at the end of each hold; law: the torque of target, position, velocity and step."""
    of_target = lambda k, *state: law(targets[int(k + 1e-9)], *state)  # noqa: E731
    return slow.closed_loop(rig, of_target, 1 / RATE, 5, len(T))[0]


@pytest.mark.parametrize("kind", ["pd", "cascade"])
def test_the_loop_is_that_of_its_equation(kind):
    total = 0.0

    def law(r, q, v, h):
        nonlocal total
        if kind == "pd":
            u = 60.0 * (r - q) + 40.0 * total - 2.0 * v
            total += (r - q) * h
        else:
            error = min(max(8.0 * (r - q), -1.5), 1.5) - v
            u = 6.0 * error + 30.0 * total
            total += error * h
        return u

    integral = {"k_i": 40.0} if kind == "pd" else {"k_vi": 30.0, "velocity_limit": 1.5}
    position = move_rig(joint(kind, **integral), refine=1)["position"]
    assert np.max(np.abs(position - by_scipy(joint(kind), law))) < 1e-9


def test_the_limits_of_the_loop_hold():
    limited = move_rig(joint(torque_limit=4.0))
    assert np.max(np.abs(limited["motor_torque"])) == pytest.approx(4.0)
    slewed = move_rig(joint(velocity_limit=0.5))
    assert np.max(np.abs(slewed["velocity"])) < 0.65 < np.max(np.abs(move_rig(joint())["velocity"]))


def test_an_integral_takes_away_what_gravity_pulls_and_does_not_wind_up():
    hanging = joint().with_values({"spring_end.gravity": 3.0, "spring_end.gravity_angle": 0.5})
    still = np.full(len(T), 0.0)
    sag = move_rig(hanging, still)["position"][-1]
    assert 60.0 * -sag == pytest.approx(3.0 * np.sin(0.5 + sag), rel=1e-3)
    held = move_rig(hanging.with_values({"controller.k_i": 300.0}), still)["position"][-1]
    assert abs(held) < 0.1 * abs(sag)
    weak = hanging.with_values({"controller.k_i": 300.0, "controller.torque_limit": 6.0})
    assert np.max(move_rig(weak)["position"]) < 0.4


def test_a_delay_delays_the_target_not_the_torque_in_the_loop():
    late = move_rig(joint().with_effect("command_delay", delay=0.04))["position"]
    assert np.max(np.abs(late[8:] - move_rig(joint())["position"][:-8])) < 1e-9
    shifted = move_rig(joint().with_effect("command_delay", delay=0.04), STEPPING + 1.0)["position"]
    assert shifted[0] > move_rig(joint())["position"][0]  # before the first target a joint had that target


def test_the_encoder_may_sit_behind_the_play():
    worn = load_rig("pd_joint").with_effect("backlash", gap=0.02).with_effect("coulomb_friction", torque=0.1)

    def lost(rig):
        moved = (move_rig(r, 0.4 * np.sin(2 * np.pi * T))["position"] for r in (rig, rig.with_effects()))
        return np.ptp(np.subtract(*moved))

    assert lost(replace(worn, encoder_end="spring_end")) > 2.0 * lost(worn)


def test_a_mit_frame_asks_for_an_angle_a_speed_and_a_torque():
    rates, torques = np.gradient(STEPPING, T), 2.0 * np.sin(2 * np.pi * 3.0 * T)
    rig = joint("mit", k_p=25.0, k_d=1.5)
    frames = np.column_stack([STEPPING, rates, torques])

    def law(frame, angle, speed, step):
        return 25.0 * (frame[0] - angle) + 1.5 * (frame[1] - speed) + frame[2]

    channels = {"reference": STEPPING, "reference_velocity": rates, "command": torques}
    stamped = {n: Channel(T, y) for n, y in channels.items()}
    record = Record({**stamped, "position": Channel(T + 1 / RATE, np.zeros(len(T)))}, source="frames")
    assert simulate(rig, record)["position"] == pytest.approx(by_scipy(rig, law, frames), abs=1e-9)
    once = with_command(record, rig)
    assert np.array_equal(with_command(once, rig)["command"].y, once["command"].y)


def test_a_p_loop_is_a_pd_loop_without_the_rest():
    alike = joint("p", k_p=60.0), joint("pd", k_p=60.0, k_d=0.0)
    assert np.array_equal(*(move_rig(rig)["position"] for rig in alike))


@pytest.mark.parametrize("kind", ["pd", "cascade", "mit"])
def test_the_linear_response_is_that_of_the_simulation(kind):
    rig = joint(kind)
    f = 4.0
    position = move_rig(rig, 0.1 * np.sin(2 * np.pi * f * T))["position"]
    wave = np.exp(-2j * np.pi * f * (T + 1 / RATE))[200:]
    hold = np.exp(-1j * np.pi * f / RATE) * np.sinc(f / RATE)
    measured = 2j * np.mean(position[200:] * wave) / 0.1
    expected = complex(model_response(rig, "position", np.array([f]))[0] * hold)
    assert measured == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"kind": "pid"}, "controller.kind"),
        ({"kind": "pd", "k_v": {"value": 1.0, "unit": "N m s/rad"}}, "controller"),
        ({"kind": "pd", "k_d": {"value": 1.0, "unit": "N m s/rad"}}, "controller.k_p"),
        ({"kind": "pd", "k_p": {"value": 1.0, "unit": "1/s"}}, "controller.k_p"),
        ({"kind": "pd", "k_p": {"value": -1.0, "unit": "N m/rad"}}, "controller.k_p"),
        ({"kind": "p", "k_p": STIFF, "k_d": {"value": 1.0, "unit": "N m s/rad"}}, "controller"),
        ({"kind": "mit", "k_p": {"value": 0.0, "unit": "N m/rad"}}, "controller.k_p"),
        ({"kind": "mit", "k_p": {**STIFF, "spread": 0.1}}, "controller.k_p"),
        ({"kind": "mit", "k_p": STIFF, "velocity_limit": {"value": 1.0, "unit": "rad/s"}}, "controller"),
    ],
)
def test_an_impossible_loop_is_refused(change, field):
    document = rig_to_document(load_rig("pd_joint"))
    with pytest.raises(RigError, match=field):
        rig_from_document({**document, "controller": change})


def test_a_record_must_have_what_commands_its_rig():
    rig = load_rig("pd_joint")
    record = synthesize(rig, Channel(T, STEPPING))
    assert set(record.channels) == {"reference", *rig.sensors}
    assert np.array_equal(with_command(record, rig)["command"].y, STEPPING)
    with pytest.raises(ChannelError, match="expected a rig with controller"):
        simulate(load_rig("bare_drive"), record)
    torques = Record({"command": Channel(T, STEPPING), "position": record["position"]}, source="torques")
    with pytest.raises(ChannelError, match="no target positions"):
        simulate(rig, torques)
