"""A load that moves begins anew behind gaps where it is, and not where the gear is."""

from dataclasses import replace

import numpy as np
import pytest
from runs import FREE, free_run, trying

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.identification.identify import identify
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel


def with_gaps(record, gaps, length):
    """Return a record without so many samples of all channels at some places, s."""
    kept = {}
    for n, c in record.channels.items():
        lost = np.any([(c.t >= a) & (c.t < a + length) for a in gaps], axis=0)
        kept[n] = Channel(c.t[~lost], c.y[~lost])
    return replace(record, channels=kept)


@pytest.mark.parametrize(("gaps", "length"), [([3.0], 0.0101), ([2.0, 4.5], 0.05)])
def test_rows_that_a_recorder_lost_are_no_misfit_where_the_output_moves(gaps, length):
    """Three lost rows of thousands made ft 230 times its noise, and no value had an interval."""
    true = FREE.with_values({"spring.stiffness": 290.0, "rotor.reflected_inertia": 0.055})
    record = with_gaps(free_run(true).between(0.0, 6.0), gaps, length)
    result = identify([record], FREE)
    assert result.verdict == "adequate"
    assert max(result.times_noise.values()) < 1.15
    for p in result.parameters:
        if p.name in ("spring.stiffness", "rotor.reflected_inertia"):
            assert not p.beside_misfit and p.value == pytest.approx(true[p.name], rel=0.01)
    assert diagnose([record], FREE, settings=trying("backlash")).verdict == "nothing_wrong"


def test_lost_rows_hide_no_cause():
    """States behind the gaps fitted without friction left a third of it to others, or hid it whole."""
    true = FREE.with_effect("coulomb_friction", torque=0.3)
    coarse = free_run(true).between(0.0, 12.0)
    finer, own = simulate(true, coarse, refine=8), simulate(true, coarse)
    channels = {n: Channel(coarse[n].t, coarse[n].y + finer[n] - own[n]) for n in finer}
    record = with_gaps(coarse.with_channels(**channels), [2.0, 4.5, 8.1], 0.05)
    diagnosis = diagnose([record], FREE, settings=trying("coulomb_friction", "quadratic_drag"))
    assert [(c.name, c.status) for c in diagnosis.causes] == [("coulomb_friction", "confirmed")]
    assert diagnosis.causes[0].parameters["torque"].value == pytest.approx(0.3, rel=0.01)
    assert diagnosis.verdict == "explained"
