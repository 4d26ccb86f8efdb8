"""The file of a law is an effect like any other: it keeps the contract and loads from a folder."""

from dataclasses import replace

import numpy as np
import pytest
import test_catalogue as contract
import test_claims as claimed
from effect_bench import RIG, command as chirp, drive

from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.effects.catalogue import catalogue, effect_named, lend
from rsea_ros.effects.effect import Claims
from rsea_ros.laws.effect_source import LawProvenance, source_of
from rsea_ros.laws.law import FittedTerm, Law, LearntCurve
from rsea_ros.laws.learn import claims_of, effect_from
from rsea_ros.laws.terms import (
    COMMAND_TERMS,
    GEAR_TERMS,
    SENSOR_TERMS,
    SPRING_TERMS,
    mode_terms,
    wave_terms,
)  # fmt: skip
from rsea_ros.laws.variables import remember
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.simulation import simulate_drive, synthesize
from rsea_ros.report.law import kin

WHERE = LawProvenance("2026-01-01", "0.0", {"run.mcap": "ab12"}, "Gain: 50 %.")
RANGES = {"w": 0.6, "q": 0.02, "theta": 10.0, "d": 0.02, "T": 30.0, "u": 24.0}
NOTHING = Claims("velocity", "neither", None)


def term(name):
    every = (*GEAR_TERMS, *COMMAND_TERMS, *SPRING_TERMS, *SENSOR_TERMS, *wave_terms(2.0))
    return next(t for t in every if t.name == name)


def law(name, *parts):
    made = tuple(FittedTerm(term(n), size, shape) for n, size, shape in parts)
    return Law(name, made[0].term.place, made[0].term.regressor, made, RANGES)


DRAG = law("law_of_speed", ("quadratic_drag", 12.0, 0.0), ("saturating_drag", 2.0, 0.1))
SPRING = law("law_of_deflection", ("cubic_spring", 4e6, 0.0), ("hysteresis", 1.0, 2e-3))


@pytest.fixture(scope="module", params=[DRAG, SPRING], ids=lambda law: law.name)
def written(request):
    """Return the effect of a written file, with its measured claims, added to the catalogue."""
    made = request.param
    text = source_of(made, NOTHING, WHERE)
    assert "Source: rsea law" in text
    with lend(effect_from(text, made.name)) as _:
        record = synthesize(RIG, chirp(280.0, 10.0))
        case = nominal_problem([check(record, RIG)], RIG).cases[0]
        claims = claims_of(made, effect_named(made.name), RIG, case)
        yield replace(effect_named(made.name), claims=claims)


def test_a_law_that_rings_names_the_effect_of_its_form():
    """A mode at 31 Hz was found, and nothing said that the catalogue has it."""
    mode = FittedTerm(next(mode_terms((31.0,))), 1.0, 31.0)
    assert kin(Law("m", "ft", "past", (mode,), RANGES)) == ": it rings at 31 Hz, as structural resonance does"
    assert kin(DRAG) == ""


def test_it_holds_the_contract_of_the_effects(written):
    contract.test_the_null_effect_equals_the_nominal_model_to_the_last_bit(written)
    contract.test_the_effect_shrinks_to_nothing_with_its_parameters(written)
    contract.test_the_step_is_short_enough(written)
    contract.test_the_simulation_is_finite_beside_a_soft_gear(written)
    contract.test_every_effect_is_described_for_people_and_for_fits(written)
    contract.test_wrong_parameters_are_refused(written)
    contract.test_the_simulation_is_finite_over_the_whole_bounds(written)


def test_its_measured_claims_hold(written):
    claimed.test_an_effect_shows_most_in_its_stated_channel(written)
    claimed.test_an_effect_has_its_stated_parity(written)
    claimed.test_an_effect_grows_with_the_amplitude_as_stated(written)
    if written.claims.passive:
        claimed.test_a_passive_effect_only_takes_energy(written)


def test_it_loads_from_a_folder_of_effects(tmp_path, monkeypatch):
    text = source_of(DRAG, NOTHING, WHERE)
    (tmp_path / "law_of_speed.py").write_text(text)
    monkeypatch.setenv("RSEA_EFFECTS", str(tmp_path))
    effect = catalogue()["law_of_speed"]
    assert [p.unit for p in effect.parameters] == ["N m s^2/rad^2", "N m", "rad/s"]
    docstring = text.split('"""')[1]
    assert "T = -quadratic_drag · ω·|ω|" in docstring and "sha256 ab12" in docstring


def test_a_learnt_curve_acts_as_its_points_say():
    x = np.linspace(-0.6, 0.6, 41)
    made = Law(
        "learnt_law_of_speed", "gear", "speed", (), RANGES, LearntCurve("w", "", x, -12.0 * x * np.abs(x))
    )
    short = law("law_of_drag", ("quadratic_drag", 12.0, 0.0))
    effects = [effect_from(source_of(each, NOTHING, WHERE), each.name) for each in (made, short)]
    with lend(*effects):
        curve, drag = (
            simulate_drive(RIG.with_effects(EffectSetting(e.name, p)), drive(duration=3.0))
            for e, p in zip(effects, ({"size": 1.0}, {"quadratic_drag": 12.0}), strict=True)
        )
    nominal = simulate_drive(RIG, drive(duration=3.0))
    difference, whole = curve["velocity"] - drag["velocity"], nominal["velocity"] - drag["velocity"]
    assert np.std(difference) < 0.02 * np.std(whole)


@pytest.mark.parametrize("name", ["lagging", "delayed"])
def test_a_memory_in_the_file_is_the_one_that_was_fitted(name):
    made = law("law_of_past", (name, 1.0, 5e-3))
    driven = drive(duration=2.0)
    with lend(effect_from(source_of(made, NOTHING, WHERE), made.name)):
        setting = EffectSetting(made.name, made.parameters)
        acting = simulate_drive(RIG.with_effects(setting), driven)
    late = remember(term(name).memory, driven.command, driven.step, 5e-3)
    expected = simulate_drive(RIG, replace(driven, command=late))
    np.testing.assert_allclose(acting["position"], expected["position"], atol=1e-9)
