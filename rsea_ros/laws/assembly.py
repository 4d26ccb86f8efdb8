"""From chosen columns to a law: coefficients in SI, one law a place; or the curve that a spline makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rsea_ros.laws.candidates import SPLINES, TermCandidate, basis_of, spline_knots
from rsea_ros.laws.columns import CaseModel
from rsea_ros.laws.dependence import Dependence
from rsea_ros.laws.gram import SELECTION, Gram
from rsea_ros.laws.law import FittedTerm, Law, LearntCurve, join_names
from rsea_ros.laws.sparse_regression import SparseLaw
from rsea_ros.laws.variable_places import ranges_of

_POINTS = 41
"""Of a learnt curve, evenly apart."""
_RIDGE = 1e-4


def law_of(
    gram: Gram, candidates: Sequence[TermCandidate], cases: Sequence[CaseModel], models: Sequence[SparseLaw]
) -> list[Law]:
    """Return the laws of some models fitted together, those of one place as one."""
    first = len(gram.prior)
    columns = [k for m in models for k in m.columns]
    if not columns:
        return []
    beta = gram.fit(np.array(columns, np.int64), SELECTION)[first:]
    parts: dict[str, list[FittedTerm]] = {}
    for k, b in zip(columns, beta, strict=True):
        candidate = candidates[k - first]
        assert candidate.term is not None
        parts.setdefault(candidate.place, []).append(
            FittedTerm(candidate.term, float(b / gram.scale[k]), candidate.shape)
        )
    laws = []
    for place, items in parts.items():
        regressor = join_names(list(dict.fromkeys(p.term.regressor for p in items)))
        law = Law(
            f"law_of_{_slug(items[0].term.regressor)}", items[0].term.place, regressor, tuple(items), {}
        )
        laws.append(
            replace(law, ranges=ranges_of(law, _all_letters(cases)), name=_name_with_place(law.name, place))
        )
    return laws


def curve_of(
    gram: Gram, candidates: Sequence[TermCandidate], cases: Sequence[CaseModel], dependence: Dependence
) -> Law:
    """Return the learnt law of a dependence: its spline, as points of a curve."""
    first, place = len(gram.prior), dependence.place
    columns = [first + k for k, c in enumerate(candidates)
               if c.part and (c.place, c.regressor) == (place, dependence.regressor)]  # fmt: skip
    beta = gram.fit(np.array(columns), SELECTION, _RIDGE)[first:] / gram.scale[columns]
    spline = next(s for s in SPLINES if (s.place, s.regressor) == (place, dependence.regressor))
    knots = spline_knots(cases, spline)
    x = np.linspace(knots[0], knots[-1], _POINTS)
    used = [c.part[2] for k in columns if (c := candidates[k - first]).part]
    curve = LearntCurve(spline.over, spline.factor, x, beta @ basis_of(x, knots)[used])
    law = Law(
        _name_with_place(f"learnt_law_of_{_slug(dependence.regressor)}", place),
        place,
        dependence.regressor,
        (),
        {},
        curve,
    )
    return replace(law, ranges=ranges_of(law, _all_letters(cases)))


def _all_letters(cases: Sequence[CaseModel]) -> dict[str, np.ndarray]:
    return {
        n: np.concatenate([c.variables.letters[n] for c in cases]) for n in cases[0].variables.letters
    }


def _slug(text: str) -> str:
    words = text.replace("'s", "").replace(",", "").replace(" at the ", " ").replace("the ", "").split()
    return "_".join(w for w in words if w != "a").replace("sensor_sensor", "sensor")


def _name_with_place(name: str, place: str) -> str:
    return name if place == "gear" or name.endswith(place) else f"{name}_at_{place}"
