"""Two effects at once: the second shows only beside the first, or changes the name of the first."""

from __future__ import annotations

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.hidden import MAIN_PARAMETER, hide
from independent.severities import drawn_parameters

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.model.rig_file import load_rig


@pytest.mark.parametrize(
    ("pair", "severity", "excitation", "seed", "duration", "gave_way"),
    [
        # the ripple is in what the lag does not explain
        (("current_loop_lag", "torque_ripple"), "medium", "multisine", 2, 7.0, ()),
        # without the base a wrong gain of the sensor is likelier
        (("base_compliance", "torque_constant_error"), "medium", "multisine", 3, 6.0, ()),
        (("hard_stop", "stribeck_friction"), "strong", "chirp_noise", 1, 8.0, ("coulomb_friction",)),
    ],
)
def test_both_causes_are_found_with_their_sizes(pair, severity, excitation, seed, duration, gave_way):
    rng = np.random.default_rng(seed)
    bench, sizes = drawn_bench(rng), {}
    for effect in pair:
        parameters = drawn_parameters(effect, severity, rng)
        bench = hide(bench, effect, parameters)
        sizes[effect] = parameters[MAIN_PARAMETER[effect]]
    diagnosis = diagnose([record_run(bench, seed, excitation, duration)], load_rig("paper_high_impedance"))
    assert diagnosis.verdict == "explained"
    values = {c.name: c.parameters[MAIN_PARAMETER[c.name]].value for c in diagnosis.causes}
    assert values == pytest.approx(sizes, rel=0.1)
    assert {r.name for r in diagnosis.rejected} >= set(gave_way)
