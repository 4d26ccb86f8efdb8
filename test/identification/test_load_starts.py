"""A load that moves begins anew behind gaps where it is, and not where the gear is."""

from dataclasses import replace

import numpy as np
import pytest

from rsea_ros import simulate
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.identification.identify import identify
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel

HELD = load_rig("paper_high_impedance").with_values({
    "rotor.reflected_inertia": 0.06, "rotor.reflected_damping": 0.5, "spring.stiffness": 270.0,
    "spring.damping": 0.3,
})  # fmt: skip
FREE = replace(HELD, clamped=frozenset({"housing_end"}), quantities={
    **HELD.quantities, "spring_end.inertia": replace(HELD.quantities["rotor.reflected_inertia"], value=0.13),
    "spring_end.damping": replace(HELD.quantities["rotor.reflected_damping"], value=0.3),
})  # fmt: skip


def with_gaps(record, gaps, length):
    """Return a record without so many samples of all channels at some places, s."""
    kept = {}
    for n, c in record.channels.items():
        lost = np.any([(c.t >= a) & (c.t < a + length) for a in gaps], axis=0)
        kept[n] = Channel(c.t[~lost], c.y[~lost])
    return replace(record, channels=kept)


@pytest.mark.parametrize(("gaps", "length"), [([6.0], 0.0101), ([2.0, 4.5, 7.0, 9.5, 12.0], 0.05)])
def test_rows_that_a_recorder_lost_are_no_misfit_where_the_output_moves(gaps, length):
    """Three lost rows of thousands made ft 230 times its noise, and no value had an interval."""
    true = FREE.with_values({"spring.stiffness": 290.0, "rotor.reflected_inertia": 0.055})
    torque = np.repeat(5.0 * np.random.default_rng(1).standard_normal(1050), 4)
    record = with_gaps(simulate(true, torque, 280.0, seed=2), gaps, length)
    result = identify([record], FREE)
    assert result.verdict == "adequate"
    assert max(result.times_noise.values()) < 1.15
    for p in result.parameters:
        if p.name in ("spring.stiffness", "rotor.reflected_inertia"):
            assert not p.beside_misfit and p.value == pytest.approx(true[p.name], rel=0.01)
    assert diagnose([record], FREE).verdict == "nothing_wrong"
