"""Truth recovered, with intervals that hold it as often as they say."""

import numpy as np
import pytest
from benches import bench, record_bench
from runs import RIG, only
from scipy.stats import binom

from rsea_ros.errors import IdentificationError
from rsea_ros.identification.identify import identify
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.remark_words import remark_sentences

SEEDS = range(8)


@pytest.mark.parametrize(
    ("name", "kind", "duration"),
    [("paper_moving_output", "white_noise", 6.0), ("bare_drive", "chirp", 12.0)],
)
def test_intervals_contain_the_truth_as_often_as_they_say(name, kind, duration):
    errors = {}  # of each parameter in its standard deviations, by seed
    for seed in SEEDS:
        nominal, true = bench(name, seed)
        for p in identify([record_bench(true, seed, duration, kind)], nominal).parameters:
            if p.name in true.values():
                error = (p.value - true[p.name]) / ((p.ci95[1] - p.ci95[0]) / (2.0 * 1.96))
                errors.setdefault(p.name, []).append(error)
    assert set(errors) == set(load_rig(name).free())
    for parameter, values in errors.items():
        inside = int(np.sum(np.abs(values) <= 1.96))
        assert binom.cdf(inside, len(SEEDS), 0.95) > 1e-3, (parameter, inside, values)
        assert np.std(values) > 0.3, f"{parameter}: intervals {1.0 / np.std(values):.1f} times too wide"


def test_torque_alone_determines_only_ratios():
    """Facts, section 3: from T_d / T_m alone K_s / J_eff and b_eff / J_eff, and no absolute value."""
    nominal, true = bench("paper_high_impedance", 2)
    result = identify([only(record_bench(true, 2, 20.0), "ft")], nominal)
    told = {p.name: p.told_by_data for p in result.parameters}
    assert all(told[name] < 0.01 for name in nominal.free()), told
    (sentence,) = remark_sentences(result.remarks)
    assert sentence.startswith("Only ratios of ")
    assert all(name in sentence for name in nominal.free())
    assert "encoder" in sentence
    rig_found = result.rig
    for name in ("rotor.reflected_damping", "spring.stiffness"):
        ratio = rig_found[name] / (rig_found["rotor.reflected_inertia"] + rig_found["chassis.inertia"])
        expected = true[name] / (true["rotor.reflected_inertia"] + true["chassis.inertia"])
        assert ratio == pytest.approx(expected, rel=0.01)
    assert abs(rig_found["spring.stiffness"] / true["spring.stiffness"] - 1.0) > 0.01


def test_the_encoder_alone_does_not_separate_the_dampings():
    nominal, true = bench("paper_high_impedance", 3)
    result = identify([only(record_bench(true, 3, 10.0), "position")], nominal)
    scale, sentence = remark_sentences(result.remarks)
    assert sentence.startswith("spring.damping")
    assert scale.startswith("No F/T sensor takes part in this fit, so every torque is known only")
    both = [rig["rotor.reflected_damping"] + rig["spring.damping"] for rig in (result.rig, true)]
    assert both[0] == pytest.approx(both[1], rel=0.01)


def test_an_effect_that_the_rig_lists_is_fitted():
    nominal, true = bench("paper_high_impedance", 4)
    record = record_bench(true.with_effect("torque_saturation", limit=18.0), 4, 20.0)
    result = identify([record], nominal.with_effect("torque_saturation", limit=25.0))
    limit = next(p for p in result.parameters if p.name == "torque_saturation.limit")
    assert limit.ci95[0] <= 18.0 <= limit.ci95[1]
    assert limit.value == pytest.approx(18.0, rel=1e-3)
    assert result.rig.effects[0].parameters["limit"] == limit.value


def test_an_effect_that_never_shows_is_not_determined():
    nominal, true = bench("paper_high_impedance", 5)
    result = identify([record_bench(true, 5)], nominal.with_effect("torque_saturation", limit=100.0))
    limit = next(p for p in result.parameters if p.name == "torque_saturation.limit")
    assert limit.told_by_data < 0.01
    assert limit.ci95 == (0.5, 200.0)
    assert "limit is not identifiable from these data: they do not" in remark_sentences(result.remarks)[0]


def test_a_rig_that_the_record_contradicts_is_refused():
    _, true = bench("paper_high_impedance", 6)
    record = record_bench(true, 6)
    with pytest.raises(IdentificationError, match="no position channel, expected one"):
        identify([only(record, "ft")], load_rig("bare_drive"))
    with pytest.raises(IdentificationError, match="no ft, deflection, position or velocity channel"):
        identify([only(record, "motor_torque")], RIG)
