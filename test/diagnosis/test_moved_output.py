"""A joint whose output something else moves: torques are judged along the measured motion.

The plant is plain Python (RK4) and shares nothing with the package.
"""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from runs import only, trying

import rsea_ros as rsea
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.errors import IdentificationError, RigError
from rsea_ros.model.rig import Quantity, Sensor
from rsea_ros.model.rig_document import rig_from_document
from rsea_ros.model.rig_file import load_rig, rig_to_document
from rsea_ros.records.record import Channel, Record

TRUE = {"rotor.reflected_inertia": 0.21, "rotor.reflected_damping": 1.9, "spring.stiffness": 310.0,
        "spring.damping": 0.55}  # fmt: skip
RATE, SECONDS, PARTS = 250.0, 12.0, 4
WALK = np.array([[0.4, 0.35, 0.3], [0.9, 0.15, 2.0], [1.7, 0.08, 4.4], [2.9, 0.03, 1.1], [6.1, 0.006, 5.0]])
PUSH = np.array([[0.3, 6.0, 0.2], [1.1, 4.0, 1.4], [2.3, 3.0, 2.9], [5.0, 2.0, 4.0], [9.0, 1.5, 5.5]])
TRIED = ("nonlinear_spring", "coulomb_friction", "ft_gain_error", "torque_constant_error", "command_delay")
SETTINGS = trying(*TRIED, max_causes=1)


def waves(table, t):
    """Return a sum of sines and its rate."""
    f, size, phase = table.T
    angle = 2.0 * math.pi * f * t[:, None] + phase
    return (np.sin(angle) @ size).tolist(), (np.cos(angle) @ (2.0 * math.pi * f * size)).tolist()


@cache
def moved(cubic=0.0):
    """Return the record of a joint whose output walks, with a spring K (d + cubic d^3)."""
    j, b, k, c = TRUE.values()
    h, steps = 1.0 / (RATE * PARTS), int(RATE * SECONDS) * PARTS
    x, v = waves(WALK, np.arange(2 * steps + 1) * h / 2)
    pushed = waves(PUSH, np.arange(steps // PARTS) / RATE)[0]

    def rates(q, w, n):
        d = q - x[n]
        torque = k * (d + cubic * d**3) + c * (w - v[n])
        return w, (u - b * w - torque) / j, torque, d

    q, w, rows, u = x[0], 0.0, [], 0.0
    for n in range(0, 2 * steps, 2):
        if n % (2 * PARTS) == 0:
            ft, d = rates(q, w, n)[2:]
            acted, u = u, pushed[n // (2 * PARTS)]
            rows.append((n * h / 2, u, acted, q, ft, d))
        v1, a1, *_ = rates(q, w, n)
        v2, a2, *_ = rates(q + h / 2 * v1, w + h / 2 * a1, n + 1)
        v3, a3, *_ = rates(q + h / 2 * v2, w + h / 2 * a2, n + 1)
        v4, a4, *_ = rates(q + h * v3, w + h * a3, n + 2)
        q, w = q + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), w + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    t, command, *shown = np.array(rows).T
    rng = np.random.default_rng(5)
    noise = {"motor_torque": 0.05, "position": 1e-5, "ft": 0.03, "deflection": 2e-5}
    sized = zip(noise.items(), shown, strict=True)
    channels = {n: y + s * rng.standard_normal(len(t)) for (n, s), y in sized}
    return Record.from_arrays(t, source="walk", command=command, **channels)


def joint():
    """Return a rig whose values are off by its stated doubt."""
    rig = load_rig("paper_moving_output")
    off = {"rotor.reflected_inertia": Quantity(0.25, 0.3), "rotor.reflected_damping": Quantity(3.0, 0.5),
           "spring.stiffness": Quantity(280.0, 0.1), "spring.damping": Quantity(0.4, 0.5),
           "gear.ratio": Quantity(50.0), "chassis.inertia": Quantity(0.0)}  # fmt: skip
    ends = {n: q for n, q in rig.quantities.items() if n.startswith("spring_end.")}
    return replace(
        rig, quantities={**off, "spring_end.inertia": Quantity(0.5, 0.5), **ends}, effects=(), sensors={},
        clamped=frozenset({"housing_end"}), motion="measured", known=frozenset({"gear.ratio"}),
        proximal="spring_end",
    )  # fmt: skip


@pytest.mark.parametrize("with_deflection", [True, False])
def test_the_values_that_such_a_record_shows_are_found(with_deflection):
    record = only(moved(), "motor_torque", "position", "ft", *["deflection"] * with_deflection)
    found = rsea.identify(record, joint()).parameters
    shown = dict(list(TRUE.items())[: 4 if with_deflection else 2])
    assert found.keys() == shown.keys()
    for name, true in shown.items():
        assert found[name].value == pytest.approx(true, rel=0.02), name


def test_a_hardening_spring_is_named_with_its_size():
    found = diagnose([moved(40.0)], joint(), settings=SETTINGS)
    (cause,) = found.causes
    assert (found.verdict, cause.name, cause.status) == ("explained", "nonlinear_spring", "confirmed")
    assert cause.parameters["cubic"].value == pytest.approx(40.0, rel=0.02)
    assert {n: found.extended_residual_rms[n] < 1.15 * found.noise_rms[n] for n in found.noise_rms} == {
        "ft": True, "motor_torque": True}  # fmt: skip


def test_a_sound_joint_has_no_cause_also_where_no_hold_of_the_log_made_its_torque():
    """A loop that is far faster than its log holds nothing from row to row."""
    run = moved()
    torque = run["motor_torque"]
    early = run.with_channels(motor_torque=Channel(torque.t + 0.4 / RATE, torque.y))
    for record in (run, early):
        assert diagnose([record], joint(), settings=SETTINGS).verdict == "nothing_wrong"


def test_what_ends_early_counts_no_longer():
    run, ends = moved(), {"motor_torque": 8.4, "ft": 9.6}
    ended = {n: np.where(run[n].t < end, run[n].y, np.nan) for n, end in ends.items()}
    cut = run.with_channels(**{n: Channel(run[n].t, y) for n, y in ended.items()})
    assert diagnose([cut], joint(), settings=SETTINGS).verdict == "nothing_wrong"


def test_an_unknown_zero_of_the_deflection_is_no_offset_of_the_torque():
    run = moved()
    shifted = run.with_channels(deflection=Channel(run["deflection"].t, run["deflection"].y + 0.01))
    tried = trying("asymmetric_friction", max_causes=1)
    rig = replace(joint(), sensors={"deflection": Sensor(noise=2e-5, zero_unknown=True)})
    assert diagnose([shifted], rig, settings=tried).verdict == "nothing_wrong"
    assert rsea.identify(shifted, rig).parameters["spring.stiffness"].value == pytest.approx(310.0, rel=0.01)


def test_a_moved_rig_comes_back_from_its_file_and_says_what_it_needs():
    assert rig_from_document(rig_to_document(joint())).motion == "measured"
    with pytest.raises(RigError, match="motion = measured with a position loop, expected simulated"):
        replace(load_rig("pd_joint"), motion="measured")
    with pytest.raises(RigError, match="motion = 'felt', expected one of simulated, measured"):
        replace(joint(), motion="felt")
    with pytest.raises(IdentificationError, match="no deflection or ft channel, expected one"):
        rsea.identify(only(moved(), "position"), joint())
