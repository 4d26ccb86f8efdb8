"""A slow lag of the motor's current looks like a damping of the rotor: the fit without it leaves the rig.

A fit of the lag that begins there stays there, and an overshoot of the current loop fits as well. Only the
fit that begins at the stated values, or a second effect beside the lag, agrees with the data and the rig.
"""


import pytest
from runs import excited, only, trying
from scripted_scores import model

from rsea_ros.diagnosis.criteria import break_tie
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.model.rig_file import load_rig

pytestmark = pytest.mark.usefixtures("brief_next_run")
LAG, DELAY = "current_loop_lag", "command_delay"
SETTINGS = trying(LAG, DELAY, "current_loop_overshoot")
RIG = load_rig("sea_two_encoders")
INERTIA = "rotor.reflected_inertia"


def torque_chirp_of(values, effects, seed=3, seconds=7.0):
    """Return a record of a locked actuator with a spring encoder, without motor current."""
    rig = RIG.with_values(values)
    for name, parameters in effects.items():
        rig = rig.with_effect(name, **parameters)
    asked = {"duration": seconds, "amplitude": 5.0, "noise": 0.0, "low": 0.1, "high": 40.0}
    return only(excited(rig, "chirp", sensors=seed, **asked), "ft", "deflection")


def test_a_slow_lag_of_the_current_is_named_and_not_what_fits_far_from_the_rig():
    truth = {INERTIA: 0.013, "rotor.reflected_damping": 5.0}
    record = torque_chirp_of(truth, {LAG: {"time_constant": 0.034}})
    found = diagnose([record], RIG, settings=SETTINGS)
    assert [(c.name, c.status) for c in found.causes] == [(LAG, "confirmed")]
    (extended,) = (p for p in found.extended if p.name == INERTIA)
    assert extended.value == pytest.approx(truth[INERTIA], rel=0.1)


def test_two_effects_are_named_where_one_fits_as_well_only_far_from_the_rig():
    effects = {LAG: {"time_constant": 0.02}, DELAY: {"delay": 4e-3}}
    record = torque_chirp_of({INERTIA: 0.011, "rotor.reflected_damping": 10.0}, effects, seconds=10.0)
    found = diagnose([record], RIG, settings=SETTINGS)
    assert {(c.name, c.status) for c in found.causes} == {(LAG, "confirmed"), (DELAY, "confirmed")}
    sizes = {n: p.value for c in found.causes for n, p in c.parameters.items()}
    assert sizes["time_constant"] == pytest.approx(0.02, rel=0.02)
    assert sizes["delay"] == pytest.approx(4e-3, abs=3e-4)


def test_a_cause_is_named_on_a_bench_whose_inertia_is_five_times_the_stated_one():
    """Truth far from the rig: the stated values are where fits may begin, not where they must end."""
    record = torque_chirp_of({INERTIA: 0.05}, {DELAY: {"delay": 8e-3}}, 5)
    found = diagnose([record], RIG, settings=SETTINGS)
    assert [(c.name, c.status) for c in found.causes] == [(DELAY, "confirmed")]
    assert [r.code for r in found.remarks if r.code == "off_rig"]


@pytest.mark.parametrize(("away", "chosen"), [(1.0, "one"), (40.0, "two")])
def test_of_equal_models_the_simpler_is_chosen_unless_it_leaves_known_values_far_behind(away, chosen):
    one, two = model(LAG, ft=1.0, prior_cost=away), model(LAG, DELAY, size=2, ft=1.0, prior_cost=0.5)
    assert break_tie([one, two], model(ft=20.0).validation) is {"one": one, "two": two}[chosen]
