"""Causes weighed by records that show nothing of them, and the sizes at which runs are rated for them."""

import numpy as np
import pytest
from slow_work import CAUSES, RIG

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import ParameterError
from rsea_ros.experiment.joint_weighing import causes_from, middles_of_runs, weigh


def test_a_cause_that_the_log_could_not_show_stays_as_likely_as_none(known):
    assert known.probability["hard_stop"] == pytest.approx(known.probability["nothing"], rel=0.1)
    assert min(known.probability.values()) > 0.05


def test_a_cause_of_which_the_log_shows_nothing_is_expected_at_its_usual_size(known):
    lag, stop = ({h.name: h for h in known.hypotheses()}[n] for n in CAUSES)
    usual = effect_named("hard_stop").typical["angle"]
    assert stop.rig_at(stop.if_there()).effects[-1].parameters["angle"] == pytest.approx(usual, rel=0.2)
    angles = [stop.rig_at(v).effects[-1].parameters["angle"] for v in stop.likely_values()]
    assert angles[0] < usual < angles[-1]
    assert np.array_equal(lag.if_there(), lag.theta)


def test_a_cause_that_may_be_none_is_expected_with_some_size(log):
    weighing = weigh([log], RIG, ["nonlinear_spring"])
    spring = next(h for h in weighing.hypotheses() if h.name == "nonlinear_spring")
    main = spring.cause_indices[0]
    assert abs(spring.if_there()[main]) > abs(spring.theta[main])
    sizes = np.abs(spring.likely_values()[:, main]) / spring.sd()[main]
    assert sizes == pytest.approx([0.2, 0.7, 1.4], abs=0.15)


def test_a_value_that_repeats_counts_once():
    kept = middles_of_runs(np.array([1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 1.0]))
    assert np.flatnonzero(kept).tolist() == [1, 3, 4, 6] or np.flatnonzero(kept).tolist() == [1, 3, 5, 6]


def test_causes_are_effects_of_the_catalogue_each_once():
    assert causes_from("backlash, hard_stop") == ("backlash", "hard_stop")
    for text in ("", "backlash,backlash", "gremlins"):
        with pytest.raises(ParameterError):
            causes_from(text)
