"""A joint commanded by positions: its causes are found from its log."""

from dataclasses import replace

import numpy as np
import pytest
from runs import trying

from rsea_ros import simulate
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.identification.excitation import JOINT, excitation
from rsea_ros.model.rig import Quantity
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record
from rsea_ros.report.remark_words import remark_sentences

pytestmark = pytest.mark.usefixtures("brief_next_run")
SETTINGS = trying("coulomb_friction", "command_delay", "backlash", max_causes=2)


def log_joint(rig):
    """Return 5 s of a joint whose inertia, damping and gravity are not those of its rig."""
    targets = excitation("chirp", replace(JOINT, duration=5.0, high=3.0))
    off = {"rotor.reflected_inertia": 0.026, "rotor.reflected_damping": 0.35, "spring_end.gravity": 0.6}
    return simulate(rig.with_values(off), targets, JOINT.rate, seed=6)


def test_friction_and_a_delay_of_the_targets_are_named():
    rig = load_rig("pd_joint")
    true = rig.with_effect("coulomb_friction", torque=0.2).with_effect("command_delay", delay=0.015)
    diagnosis = diagnose([log_joint(true)], rig, settings=SETTINGS)
    assert {c.name for c in diagnosis.causes} == {"coulomb_friction", "command_delay"}
    sizes = {c.name: next(iter(c.parameters.values())).value for c in diagnosis.causes}
    assert sizes["coulomb_friction"] == pytest.approx(0.2, rel=0.03)
    assert sizes["command_delay"] == pytest.approx(0.015, abs=3e-4)
    assert diagnosis.verdict == "explained"
    assert any("cannot determine the play in the gear" in s for s in remark_sentences(diagnosis.remarks))


def log_frames(own=None):
    """Return 5 or 6 s of a joint with friction that follows MIT frames at 200 Hz, firmware at 1 kHz, by RK2.

    own: its motor torque is logged, that of the same frame or of the one before.
    """
    t = 0.005 * np.arange(1200 if own is None else 1000)
    w = 2.0 * np.pi * np.array([[0.4], [2.1], [7.0]])
    sizes = np.array([[0.5], [0.2], [0.05]])
    angles, rates = (sizes * np.sin(w * t)).sum(0), (sizes * w * np.cos(w * t)).sum(0)
    torques = 1.2 * np.sin(2.0 * np.pi * 3.3 * t) * np.exp(np.sin(t))

    def acceleration(speed):
        return (u - 0.2 * speed - 0.15 * np.tanh(speed / 2e-3)) / 0.038

    u, q, v, h, shown, held = 0.0, 0.0, 0.0, 2e-4, [], []
    for angle, rate, torque in zip(angles, rates, torques, strict=True):
        shown.append(q)
        before = u
        for k in range(25):
            if k % 5 == 0:
                u = 30.0 * (angle - q) + 0.8 * (rate - v) + torque
            if k == 0:
                held.append((before, u))
            middle = v + 0.5 * h * acceleration(v)
            q, v = q + h * middle, v + h * acceleration(middle)
    noise = np.random.default_rng(3)
    noisy = np.array(shown) + 2e-4 * noise.standard_normal(len(t))
    channels = {"reference": angles, "reference_velocity": rates, "command": torques, "position": noisy}
    if own is not None:
        channels["motor_torque"] = np.array(held)[:, int(own)] + 0.02 * noise.standard_normal(len(t))
    return Record({n: Channel(t, y) for n, y in channels.items()}, source="frames")


def test_friction_of_a_joint_that_follows_mit_frames_is_named_with_its_size():
    found = diagnose([log_frames()], mit_joint(), settings=replace(SETTINGS, max_causes=1))
    (cause,) = found.causes
    low, high = cause.parameters["torque"].ci95
    assert (found.verdict, cause.name, cause.status) == ("explained", "coulomb_friction", "confirmed")
    assert low < 0.15 < high < 0.16


@pytest.mark.parametrize("own", [False, True])
def test_a_log_with_the_torque_of_its_own_frame_has_no_other_cause(own):
    """It was an encoder that is read a tick late, `confirmed`, or an overshoot of the current."""
    tried = trying("coulomb_friction", "command_delay", "encoder_delay", "current_loop_overshoot")
    found = diagnose([log_frames(own)], mit_joint(), settings=tried)
    assert [(c.name, c.status) for c in found.causes] == [("coulomb_friction", "confirmed")]
    (clock,) = (p.value for p in found.extended if p.name == "clock.motor_torque")
    assert (clock > 0.4e-3) is own


def mit_joint():
    """Return a joint without spring and gravity that follows MIT frames."""
    rig = load_rig("pd_joint")
    values = {n: q for n, q in rig.quantities.items() if n.split(".")[0] not in ("spring", "controller")}
    gains = {"k_p": 30.0, "k_d": 0.8, "sample_time": 1e-3}
    values |= {f"controller.{n}": Quantity(v) for n, v in gains.items()}
    values |= {"spring_end.gravity": Quantity(0.0), "rotor.reflected_inertia": Quantity(0.03, 0.5)}
    return replace(rig, quantities=values, rigid_spring=True, loop="mit")


def test_a_joint_with_other_values_has_no_cause():
    rig = load_rig("pd_joint")
    diagnosis = diagnose([log_joint(rig)], rig, settings=SETTINGS)
    assert (diagnosis.verdict, diagnosis.causes) == ("nothing_wrong", ())


def test_a_joint_that_its_weight_holds_is_judged_by_its_motion():
    """Its motor torque along the measured motion is smeared at each reversal, and says less."""
    parts, noise = 32, np.random.default_rng(4)
    t, h = np.arange(1200) / 200.0, 1.0 / 200.0 / parts
    command = sum(0.4 * np.sin(2.0 * np.pi * f * t + 2.0 * f**2) for f in (0.17, 0.5, 0.83, 1.5, 2.33, 3.17))
    q, v, moved = 0.0, 0.0, [(0.0, 0.0)] * 2 * parts  # 10 ms
    for torque in np.repeat(command, parts):
        net = torque - 3.1 * np.sin(q) - 0.045 * v
        stopping = net + v * 0.16 / h
        v += (net - min(max(stopping, -0.15), 0.15)) / 0.16 * h
        q += v * h
        moved.append((q, v))
    late = np.array(moved)[parts - 1 :: parts][:1200].T
    channels = {"command": Channel(t, command)}
    for name, y, at, sigma in (
        ("motor_torque", command, t, 0.01), ("position", late[0], t + 5e-3, 5e-4),
        ("velocity", late[1], t + 5e-3, 0.02),
    ):  # fmt: skip
        channels[name] = Channel(at, y + sigma * noise.standard_normal(1200))
    tried = trying("coulomb_friction", "stribeck_friction", "encoder_delay", "quadratic_drag")
    found = diagnose([Record(channels, "held")], load_rig("pendulum"), settings=tried)
    assert (found.verdict, found.channel, found.extended_rig.motion) == ("explained", "position", "simulated")
    assert {(c.name, c.status) for c in found.causes} == {
        ("coulomb_friction", "confirmed"), ("encoder_delay", "confirmed")
    }  # fmt: skip
    for cause in found.causes:
        low, high = next(iter(cause.parameters.values())).ci95
        true = {"coulomb_friction": 0.15, "encoder_delay": 0.01}[cause.name]
        assert low < true < high < 1.1 * true
