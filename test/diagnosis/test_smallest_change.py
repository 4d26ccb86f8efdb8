"""The smallest change that a recording would have shown: half as large again it is found in another one."""

from dataclasses import replace

import pytest
from runs import RIG, excited, only, trying

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.smallest_change import of_size, size_of, smallest_changes
from rsea_ros.effects.catalogue import effect_named

COMMAND = {"kind": "chirp", "duration": 5.0, "amplitude": 28.0, "noise": 14.0}
SETTINGS = trying("coulomb_friction", "ft_gain_error", "command_delay", max_causes=1)


@pytest.fixture(scope="module")
def found():
    run = excited(RIG, sensors=3, **COMMAND)
    diagnosis = diagnose([run], RIG, settings=SETTINGS)
    assert diagnosis.verdict == "nothing_wrong"
    return {s.name: s for s in smallest_changes(diagnosis, [run])}, run


@pytest.mark.parametrize(
    ("name", "times", "shown"), [("coulomb_friction", 0.3, False), ("command_delay", 1.5, True)]
)
def test_half_as_large_again_it_is_found(found, name, times, shown):
    effect, smallest = effect_named(name), found[0][name]
    size = size_of(effect)
    assert smallest.parameter == size.name
    share = times * (smallest.value - size.null) / (size.typical - size.null)
    changed = RIG.with_effect(name, **of_size(effect, size, share))
    again = diagnose([excited(changed, sensors=17, **COMMAND)], RIG, settings=SETTINGS)
    assert [c.name for c in again.causes] == [name] * shown


def test_the_size_of_a_mode_is_its_participation_and_its_form_stays():
    mode = effect_named("structural_resonance")
    size = size_of(mode)
    part = size.null + 0.5 * (size.typical - size.null)
    assert size.name == "participation"
    assert of_size(mode, size, 0.5) == pytest.approx({**mode.typical, "participation": part})


def test_what_a_fit_answers_hardly_shows(found):
    """A motor constant, where only the angle is measured: all other values are doubtful, and answer it."""
    names = ("rotor.reflected_inertia", "rotor.reflected_damping", "spring.stiffness", "spring.damping")
    doubtful = {n: replace(RIG.quantities[n], spread=0.5) for n in names}
    rig = replace(RIG, quantities={**RIG.quantities, **doubtful}, known=RIG.known - set(names))
    run, settings = only(found[1], "position"), trying("torque_constant_error", max_causes=1)
    (gain,) = smallest_changes(diagnose([run], rig, settings=settings), [run])
    assert not abs(gain.value - 1.0) < 0.1
    assert abs(found[0]["ft_gain_error"].value - 1.0) < 0.01
