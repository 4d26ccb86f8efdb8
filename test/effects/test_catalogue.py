"""The contract of every effect of the catalogue; test_outside_effect.py adds one by one file."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from effect_bench import ON_THE_BENCH, RIG, SIGNALS, command, difference, drive, record_of, rms, simulate

from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.effects.signal_table import Port
from rsea_ros.errors import ParameterError
from rsea_ros.model.drive import drive_from
from rsea_ros.model.rig_file import load_rig

CONTRACT = {
    "torque_constant_error": {"gain": "1"},
    "coulomb_friction": {"torque": "N m"},
    "stribeck_friction": {"coulomb_torque": "N m", "stribeck_torque": "N m", "stribeck_velocity": "rad/s"},
    "asymmetric_friction": {"offset": "N m", "viscous_difference": "N m s/rad"},
    "load_dependent_friction": {"coefficient": "1"},
    "backlash": {"gap": "rad"},
    "nonlinear_spring": {"cubic": "1/rad^2"},
    "spring_hysteresis": {"torque": "N m", "angle": "rad"},
    "structural_resonance": {"frequency": "Hz", "damping_ratio": "1", "participation": "1"},
    "command_delay": {"delay": "s"},
    "current_loop_lag": {"time_constant": "s"},
    "ft_sensor_lag": {"time_constant": "s"},
    "torque_ripple": {"amplitude": "N m", "cycles_per_revolution": "1", "phase": "rad"},
    "torque_saturation": {"limit": "N m"},
    "ft_drift": {"drift": "N m"},
    "ft_bias": {"bias": "N m"},
    "ft_gain_error": {"gain": "1"},
    "mains_interference": {"amplitude": "N m", "frequency": "Hz"},
    "base_compliance": {"stiffness": "N m/rad", "inertia": "kg m^2"},
    "stiffness_drift": {"relative_change": "1"},
    "damping_drift": {"relative_change": "1"},
    "hard_stop": {"angle": "rad", "stiffness": "N m/rad"},
    "gear_compliance": {"stiffness": "N m/rad"},
}
"""Names and units that other programs rely on."""

HALF_STEP = {"ft": 3e-3, "position": 1.2e-6, "velocity": 6e-5}
"""What halving the step may change: a tenth of the torque's noise, a fifth and a third of the others'."""

every_effect = pytest.mark.parametrize("effect", ON_THE_BENCH, ids=lambda e: e.name)
RIGS = "paper_high_impedance", "paper_moving_output", "prototype_knee", "bare_drive", "pendulum"


def test_every_effect_of_the_contract_is_in_the_catalogue():
    assert set(CONTRACT) | {"viscoelastic_spring", "ft_delay", "encoder_delay"} <= set(catalogue())
    assert all(effect.inspect for effect in catalogue().values()), "what a mechanic looks at"


@pytest.mark.parametrize("name", CONTRACT)
def test_parameters_are_those_of_the_contract(name):
    ours = {p.name: p.unit for p in effect_named(name).parameters}
    assert CONTRACT[name].items() <= ours.items()
    assert list(ours)[: len(CONTRACT[name])] == list(CONTRACT[name]), "main parameter first"


@every_effect
def test_the_null_effect_equals_the_nominal_model_to_the_last_bit(effect):
    driven = drive(duration=2.0)
    nominal, extended = simulate(driven), simulate(driven, effect.name, effect.null)
    for channel, values in nominal.items():
        np.testing.assert_array_equal(extended[channel], values)


@every_effect
def test_the_effect_shrinks_to_nothing_with_its_parameters(effect):
    driven, sizes = drive(duration=2.0), []
    for share in (1.0, 0.1):
        at = {p.name: p.typical / share if p.null == np.inf else p.null + share * (p.typical - p.null)
              for p in effect.parameters}  # fmt: skip
        sizes.append(rms(difference(simulate(driven, effect.name, at), simulate(driven))))
    assert sizes[0] > 3.0, "a typical size shows above the noise"
    assert sizes[1] < 0.5 * sizes[0]


@every_effect
def test_the_step_is_short_enough(effect):
    coarse, fine = (simulate(drive(refine=n), effect.name, effect.typical) for n in (1, 2))
    for name in SIGNALS:
        assert rms(coarse[name] - fine[name]) < HALF_STEP[name]


@every_effect
def test_the_simulation_is_finite_over_the_whole_bounds(effect):
    driven, bounds = drive(duration=0.5), [(p.low, p.high) for p in effect.parameters]
    corners = ([p.typical for p in effect.parameters], *itertools.product(*bounds))
    for bench in map(load_rig, RIGS):
        if effect.name == "base_compliance" and "spring_end" not in bench.clamped:
            with pytest.raises(ParameterError, match="spring_end is free, expected clamped"):
                simulate(driven, effect.name, effect.typical, bench)
            continue
        for corner in corners:
            parameters = dict(zip(effect.typical, corner, strict=True))
            for values in simulate(driven, effect.name, parameters, bench).values():
                assert np.abs(values).max() < 1e5, (bench.name, parameters)


@every_effect
def test_the_simulation_is_finite_beside_a_soft_gear(effect):
    soft = RIG.with_values({"gear.stiffness": 1e4})
    for values in simulate(drive(duration=1.0), effect.name, effect.typical, soft).values():
        assert np.abs(values).max() < 100.0


@every_effect
def test_every_effect_is_described_for_people_and_for_fits(effect):
    assert effect.about and len(effect.about) < 80
    assert all(p.name in effect.equation for p in effect.parameters), effect.equation
    for p in effect.parameters:
        assert p.low < p.high
        assert all(p.low <= v <= p.high for v in (p.typical, *p.starts)), p.name
        assert not p.logarithmic or p.low > 0.0
        assert 15 < len(p.reason) < 110 or p.reason == "a share", p.name


@every_effect
def test_wrong_parameters_are_refused(effect):
    good = effect.typical
    with pytest.raises(ParameterError, match=f"{effect.name}: unknown parameter 'colour'"):
        simulate(drive(duration=1.0), effect.name, {**good, "colour": 1.0})
    with pytest.raises(ParameterError, match=f"parameter '{effect.main.name}' is missing"):
        effect.vector({n: v for n, v in good.items() if n != effect.main.name})
    with pytest.raises(ParameterError, match=f"{effect.main.name} = nan"):
        effect.vector({**good, effect.main.name: np.nan})


def test_an_unknown_effect_is_refused():
    with pytest.raises(ParameterError, match="'stickiness': not in the catalogue, expected one of"):
        effect_named("stickiness")


@pytest.mark.parametrize("source", ["1 / 0", "def", "import no_such_module", "raise MemoryError"])
def test_a_file_that_fails_is_a_fault_of_that_file(tmp_path, monkeypatch, source):
    (tmp_path / "broken.py").write_text(source)
    monkeypatch.setenv("RSEA_EFFECTS", str(tmp_path))
    with pytest.raises(ParameterError, match=r"RSEA_EFFECTS: .*broken\.py: \w+Error"):
        catalogue()


@pytest.mark.parametrize("port", [Port.COMMAND, Port.MOTOR, Port.SENSOR])
def test_an_effect_that_would_read_a_state_where_none_is_filled_is_refused(port):
    """A torque constant that depends on GEAR_ANGLE changed nothing at all, in silence."""
    with pytest.raises(ParameterError, match=rf"torque_ripple: reads at port {port.name}, expected"):
        replace(effect_named("torque_ripple"), port=port)


def test_the_measured_current_shows_only_what_is_done_to_the_command():
    driven = drive(duration=1.0)
    nominal = simulate(driven)["motor_torque"]
    shown = {e.name for e in ON_THE_BENCH
             if not np.array_equal(simulate(driven, e.name, e.typical)["motor_torque"], nominal)}  # fmt: skip
    assert shown == {e.name for e in catalogue().values() if e.port == Port.COMMAND}


def test_the_longest_delay_is_kept_at_a_short_step():
    commanded = command(rate=280.0, duration=1.0)
    late = replace(commanded, t=commanded.t + 17 / 280.0)
    shifted = simulate(drive_from(record_of(commanded)))["position"][:-17]
    delayed = simulate(drive_from(record_of(commanded), refine=4), "command_delay", {"delay": 17 / 280.0})
    assert late.t[0] > 0.06
    np.testing.assert_allclose(delayed["position"][17:], shifted, atol=1e-9)
