"""Sums of products give the fits, losses and choices that the rows themselves give."""

from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.laws.sparse_regression import (
    FOLDS,
    HELD_BACK,
    SELECTION,
    SparseLaw,
    _acts_right,
    _same_form,
    dependences,
    families,
    fold_sums,
    gram_of,
    groups_of,
    paths,
    simplest,
    standard_error,
)
from rsea_ros.laws.variables import GROUPS

EVERY, N = 4 * GROUPS, 4 * GROUPS * 2 * 30
RNG = np.random.default_rng(7)
GROUP, CHANNEL = np.repeat(np.arange(EVERY), 60), np.tile(np.repeat([0, 1], 30), EVERY)
NOMINAL = RNG.standard_normal((N, 2)) * [1.0, 30.0]
COLUMNS = [RNG.standard_normal(N) * s for s in (1.0, 0.01, 5.0, 1.0)]
NOISE = np.where(CHANNEL == 0, 1.0, 3.0) * RNG.standard_normal(N)
RESIDUAL = NOISE + 0.4 * COLUMNS[0] + 30.0 * COLUMNS[1] + 0.01 * NOMINAL[:, 1]
PRIOR = np.array([0.5, 60.0])


def rows():
    parts = {(g, c): np.flatnonzero((g == GROUP) & (c == CHANNEL)) for g in range(EVERY) for c in (0, 1)}
    return SimpleNamespace(
        residual=RESIDUAL, nominal=NOMINAL, channels=("ft", "position"), parts=parts, prior=PRIOR
    )


GRAM = gram_of(rows(), COLUMNS)
X = np.column_stack([NOMINAL, *COLUMNS])
SIZE = np.sqrt(np.mean(X**2, axis=0))


def squares(left, groups):
    """Return the squares of a residual by channel over some groups."""
    return np.array([np.sum(left[np.isin(GROUP, groups) & (c == CHANNEL)] ** 2) for c in (0, 1)])


def fitted(columns, groups, ridge=1e-6, weight=None):
    """Return the coefficients of scaled columns, each channel weighted by its own residual three times."""
    which = [0, 1, *columns]
    x, inside = X[:, which] / SIZE[which], np.isin(GROUP, groups)
    prior = np.append(PRIOR / SIZE[:2], np.zeros(len(columns)))
    beta, count = np.zeros(len(which)), 30.0 * len(groups)
    for _ in range(3 if weight is None else 1):
        left = squares(RESIDUAL - x @ beta, groups) / count
        w = np.sqrt((1.0 / np.maximum(left, 1.0) if weight is None else weight)[CHANNEL[inside]])
        a, b = x[inside] * w[:, None], RESIDUAL[inside] * w
        ridges = np.sqrt(ridge * np.sum(a**2, axis=0) + prior**2)
        below = np.diag(ridges), np.zeros(len(which))
        beta = np.linalg.lstsq(np.vstack([a, below[0]]), np.append(b, below[1]), rcond=None)[0]
    return beta


def test_groups_are_those_of_the_sets_of_blocks():
    assert groups_of([1]).tolist() == list(range(GROUPS, 2 * GROUPS))
    assert [*SELECTION, *HELD_BACK] == list(range(EVERY)) and HELD_BACK[0] == 3 * GROUPS


def test_a_column_is_scaled_to_its_size_and_one_of_nothing_is_not():
    assert GRAM.scale == pytest.approx(SIZE)
    assert gram_of(rows(), [np.zeros(N)]).scale[2] == 1.0
    assert GRAM.penalty == pytest.approx([*(PRIOR / SIZE[:2]) ** 2, 0, 0, 0, 0])
    assert GRAM.count.tolist() == np.full((EVERY, 2), 30.0).tolist() and GRAM.nominal.tolist() == [0, 1]


@pytest.mark.parametrize("columns", [[], [2], [3, 2]])
def test_fits_and_losses_are_those_of_the_rows(columns):
    beta = GRAM.fit(np.array(columns, int), SELECTION)
    assert beta == pytest.approx(fitted(columns, SELECTION), rel=1e-3, abs=1e-4)
    which = [0, 1, *columns]
    left = RESIDUAL - X[:, which] / SIZE[which] @ beta
    loss = GRAM.loss(np.array(columns, int), beta)
    assert loss.shape == (EVERY, 2)
    for g in (0, EVERY - 1):
        assert loss[g] == pytest.approx(squares(left, [g]), rel=1e-4)


def test_held_out_groups_are_judged_by_fits_without_their_set():
    out = GRAM.held_out(np.array([2, 3]))
    which = [0, 1, 2, 3]
    for fold in FOLDS:
        others = groups_of([f for f in FOLDS if f != fold])
        left = RESIDUAL - X[:, which] / SIZE[which] @ fitted([2, 3], others)
        at = groups_of([fold])[0]
        assert out[at] == pytest.approx(squares(left, [at]), rel=1e-3)
    assert not out[HELD_BACK].any()
    ratio = squares(np.sqrt(10.0) * NOISE, SELECTION) / (30.0 * len(SELECTION))
    given = np.array([10.0 * squares(NOISE, [g]) for g in range(EVERY)])
    assert GRAM.weights(given, SELECTION) == pytest.approx(1.0 / ratio)
    assert GRAM.weights(np.zeros((EVERY, 2)), SELECTION).tolist() == [1.0, 1.0]


def test_the_loss_of_folds_is_that_of_fits_with_stated_weights():
    weight = np.array([1.0, 0.1])
    total = 0.0
    for fold in FOLDS:
        beta = fitted([2], groups_of([f for f in FOLDS if f != fold]), 1e-7, weight)
        left = RESIDUAL - X[:, [0, 1, 2]] / SIZE[[0, 1, 2]] @ beta
        total += float(weight @ squares(left, groups_of([fold])))
    assert fold_sums(GRAM, weight).loss(np.array([0, 1, 2])) == pytest.approx(total, rel=1e-4)


def candidate(name="x", place="gear", regressor="speed", *, part=None, **term):
    made = {"name": name, "shape": "", "memory": "", "is_drag": False} | term
    return SimpleNamespace(
        term=None if part is not None else SimpleNamespace(**made), part=part, place=place,
        regressor=regressor, shape=term.get("at", 0.0),
    )  # fmt: skip


def test_the_terms_that_explain_most_enter_first_at_their_place():
    given = [candidate("strong"), candidate("weak"), candidate("other", "ft"), candidate("none")]
    found = paths(GRAM, given, most=2)
    told = [(m.place, m.columns) for m in found]
    assert told == [("gear", (2,)), ("gear", (2, 3)), ("ft", (4,))]
    best = GRAM.held_out(np.array(found[1].columns))
    assert found[1].left == pytest.approx(best)
    alike = [candidate("one", at=0.1), candidate("one", at=0.2)]
    assert [m.columns for m in paths(GRAM, alike, most=3)] == [(2,)]
    assert paths(GRAM, [candidate(part=0), candidate(part=1)]) == []
    assert paths(GRAM, [candidate(part=0), *given[1:2]], given=(2,))[0].left == pytest.approx(best)


def test_a_drag_that_would_drive_is_passed_over():
    drag, drives = candidate(is_drag=True), candidate()
    assert _acts_right(GRAM, [drag, drives], [2]) and not _acts_right(
        gram_of(rows(), [-COLUMNS[0]]), [drag], [2]
    )
    assert _acts_right(gram_of(rows(), [-COLUMNS[0]]), [drives], [2])
    assert paths(gram_of(rows(), [-COLUMNS[0]]), [drag]) == []


@pytest.mark.parametrize(
    ("changes", "same"),
    [
        ({}, True), ({"name": "y"}, False), ({"at": 0.2}, True),
        ({"at": 0.2, "shape": "cycles_per_revolution"}, False), ({"at": 0.2, "memory": "lag"}, False),
        ({"at": 0.2, "memory": "delay"}, False), ({"at": 0.2, "memory": "ring"}, False),
        ({"at": 0.2, "memory": "dahl"}, True), ({"memory": "ring"}, True),
    ],
)  # fmt: skip
def test_shapes_of_one_term_are_one_form_waves_and_pasts_are_many(changes, same):
    assert _same_form(candidate(**changes), candidate(**{**changes, "name": "x", "at": 0.0})) == same


def law(columns, factor, lift=0.0):
    left = factor * GRAM.count.copy()
    left[::2] += lift
    return SparseLaw("gear", columns, left)


def test_the_shortest_law_within_a_standard_error_is_taken():
    assert law((2,), 1.0).minus_log_likelihood(GRAM) == pytest.approx(0.5 * 60.0 * len(SELECTION))
    twice = 0.5 * 60.0 * len(SELECTION) * (np.log(2.0) + 1.0)
    assert law((2,), 2.0).minus_log_likelihood(GRAM) == pytest.approx(twice)
    assert law((2,), 0.5).minus_log_likelihood(GRAM) == pytest.approx(0.25 * 60.0 * len(SELECTION))
    best = law((2, 3), 2.0)
    assert simplest([best, law((2,), 2.09)], GRAM).columns == (2,)
    assert simplest([best, law((2,), 2.11)], GRAM).columns == (2, 3)
    assert simplest([best, law((4, 5), 2.01)], GRAM).columns == (2, 3)
    values = np.array([1.0, 2.0, 4.0])
    assert standard_error(values) == pytest.approx(np.sqrt(7.0 / 3.0) * np.sqrt(3.0))
    lone = law((2,), 2.0)
    lone.left[0] += 40.0 * 2.0 * 60.0  # in one of many groups: within its own scatter
    assert simplest([best, lone], GRAM).columns == (2,)


def test_families_are_splines_and_what_no_spline_can_say():
    given = [
        candidate(part=0), candidate("friction"), candidate("waves", shape="cycles_per_revolution"),
        candidate("past", memory="lag"), candidate("tilt", regressor="angle"),
        candidate("bias", "ft", "angle"),
    ]  # fmt: skip
    assert families(given, 10) == {
        ("gear", "speed"): [10, 12, 13], ("gear", "angle"): [14], ("ft", "angle"): [15]
    }  # fmt: skip


def test_a_dependence_is_the_share_of_the_power_above_the_noise_that_a_variable_explains():
    given = [candidate(regressor=r) for r in ("load", "speed", "nothing", "none")]
    found = {d.regressor: d for d in dependences(GRAM, given)}
    none = GRAM.held_out(np.array([], int))
    weight = GRAM.weights(none, SELECTION)
    room = float(((none - GRAM.count)[SELECTION] @ weight).sum())
    gain = (none - GRAM.held_out(np.array([2]), 1e-4))[SELECTION] @ weight
    assert found["load"].share == pytest.approx(gain.sum() / room)
    assert found["load"].se == pytest.approx(np.std(gain, ddof=1) * np.sqrt(len(gain)) / room)
    assert found["load"].beside == pytest.approx(gain.sum() / float((none[SELECTION] @ weight).sum()))
    shares = [d.share for d in dependences(GRAM, given)]
    assert shares == sorted(shares, reverse=True) and abs(found["none"].share) < 0.05
    beside = {d.regressor: d for d in dependences(GRAM, given, given=(2,))}
    law_left = GRAM.held_out(np.array([2]))
    near = GRAM.weights(law_left, SELECTION)
    more = (law_left - GRAM.held_out(np.array([2, 3]), 1e-4))[SELECTION] @ near
    assert beside["speed"].beside == pytest.approx(more.sum() / float((law_left[SELECTION] @ near).sum()))
    assert beside["speed"].beside_se == pytest.approx(
        np.std(more, ddof=1) * np.sqrt(len(more)) / float((law_left[SELECTION] @ near).sum())
    )
    assert abs(beside["load"].beside) < 1e-3 and beside["load"].share == pytest.approx(found["load"].share)
