"""The files of fitted laws: fitted values, measured claims, provenance, and points for figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.effects.catalogue import lend
from rsea_ros.effects.effect import Claims, Effect
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.unknowns import apply
from rsea_ros.laws.columns import case_model
from rsea_ros.laws.effect_source import LawProvenance, source_of
from rsea_ros.laws.law import Law
from rsea_ros.laws.measured_claims import claims_of
from rsea_ros.laws.refinement import Refined, effect_from
from rsea_ros.laws.result import FigurePoints, WrittenLaw
from rsea_ros.laws.variable_places import letters_of
from rsea_ros.model.rig import EffectSetting

_POINTS = 4000
"""Of the missing torque that are drawn."""
LAW = "law"
"""What a law of a past is drawn over: its own value, for no variable of the moment tells it."""
_FIRST = ("theta", "h", "d", "w", "u", "T", "q", "t", "share")
_NO_PROVENANCE = LawProvenance("an unknown date", "0", {"unknown": "0"}, "")


@dataclass(frozen=True)
class Draft:
    """A law with the effect that its file makes, before the fit."""

    law: Law
    effect: Effect

    @staticmethod
    def source(law: Law) -> str:
        """Return the text of a draft's file."""
        return source_of(law, Claims("velocity", "neither", None), _NO_PROVENANCE)


def finish_laws(
    drafts: Sequence[Draft], refined: Refined, cases: Sequence[Case], provenance: LawProvenance | None,
    gain: float, ci95: tuple[float, float],
) -> list[WrittenLaw]:  # fmt: skip
    """Return the laws as they were fitted, with their files."""
    where = provenance or _NO_PROVENANCE
    held_out_gain = (
        f"Gain on blocks of time that took part in no fit and no choice: {100 * gain:.1f} % "
        f"(95 %: {100 * ci95[0]:.1f} to {100 * ci95[1]:.1f} %)."
    )
    problem = replace(refined.solution.problem, cases=tuple(cases))
    rig = apply(problem.rig, problem.unknowns, refined.solution.theta)[0]
    written = []
    for draft in drafts:
        name = draft.effect.name
        values = refined.parameters(name)
        if not any(values[n] for n in _sizes(draft.law)):
            continue
        intervals = {n: refined.ci95[f"{name}.{n}"] for n in values if f"{name}.{n}" in refined.ci95}
        law = draft.law if draft.law.is_learnt else draft.law.with_parameters(values, intervals)
        shown = torque_points(problem, refined, law, values)
        whole = len(law.parts) == len(draft.law.parts)
        effect = draft.effect if whole else effect_from(Draft.source(law), law.name)
        with lend(effect):
            claims = claims_of(law, effect, rig, cases[0])
        written.append(
            WrittenLaw(law, effect, source_of(law, claims, replace(where, gain=held_out_gain)), claims, shown)
        )
    return written


def torque_points(problem: Problem, refined: Refined, law: Law, values: dict[str, float]) -> FigurePoints:
    """Return the missing torque of the fitted model without a law, over the law's variable."""
    off = {n: 0.0 if n in _sizes(law) else v for n, v in values.items()}
    rig = problem.rig
    others = [e if e.name != law.name else EffectSetting(law.name, off) for e in rig.effects]
    names = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(f"{law.name}.")]
    rest = replace(problem, rig=rig.with_effects(*others), unknowns=tuple(problem.unknowns[i] for i in names))
    theta = refined.solution.theta[names]
    model = case_model(rest, theta, rest.cases[0], rest.outputs(theta)[0], law.place)
    over = law.curve.over if law.curve is not None else _most(law, model.variables.letters)
    letters, t = model.variables.letters, model.missing.t
    offset = 0.5 * model.variables.step if model.injector else 0.0
    at = model.variables.step * np.arange(len(letters["t"])) + offset
    inside = np.linspace(0.02, 0.98, min(_POINTS, len(t))) * (len(t) - 1)
    k = np.unique(inside.astype(np.int64))
    course = law.values(model.variables) * (values.get("size", 1.0))
    if law.parts and law.parts[0].term.memory:
        over, letters = LAW, {**letters, LAW: course}
    return FigurePoints(
        t=t[k], x=np.interp(t[k], at, letters[over]), values=model.missing.torque[k],
        law=np.interp(t[k], at, course), over=over, sd=model.missing.sd,
    )  # fmt: skip


def _sizes(law: Law) -> set[str]:
    return {"size"} if law.is_learnt else {c for c, _ in law.names}


def _most(law: Law, letters: dict[str, np.ndarray] | object) -> str:
    """Return the variable over which a law is drawn: that of its largest term."""
    lead = replace(law, parts=law.parts[:1])
    used = letters_of(lead)
    return next((n for n in _FIRST if n in used), "t")
