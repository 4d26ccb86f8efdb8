"""The effect file of a law, with the claims that the data support."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rsea_ros.diagnosis.candidate import on_blocks
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import lend
from rsea_ros.effects.effect import Claims, Effect, Parity
from rsea_ros.identification.confidence import confidence_of, interval
from rsea_ros.identification.problem import Case
from rsea_ros.identification.solver import solve
from rsea_ros.identification.unknowns import start_vector, unknowns_of_effect
from rsea_ros.laws.choice import FITTED, Base
from rsea_ros.laws.effect_source import LawProvenance, source_of
from rsea_ros.laws.law import FigurePoints, Law, WrittenLaw, letters_of
from rsea_ros.laws.variables import case_model
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.outputs.files import write_new
from rsea_ros.plugins import plugin_constant
from rsea_ros.records.record import FloatArray

_LONGEST = 10.0
"""s of the record that are simulated."""
_WHOLE = 0.12
"""How near to a whole number an exponent must be, at every amplitude, to be one."""
_SHARES = (0.3, 0.6, 1.2)
"""Of the record's amplitude."""
_ODD, _EVEN = 1e-7, 0.95


def claims_of(law: Law, effect: Effect, rig: Rig, case: Case) -> Claims:
    """Return channel, parity, exponent and passivity of a law; along a measured motion only the last."""
    passive = bool(law.parts) and law.place == "gear" and all(p.term.is_drag for p in law.parts)
    drive = case.drive
    if not isinstance(drive, Drive) or rig.loop is not None:
        return Claims("motor_torque", "neither", None, passive)
    steps = min(len(drive.command), int(_LONGEST / drive.step))
    kept = {n: at[at <= steps] for n, at in drive.at.items()}
    still = replace(drive, initial=(0.0, 0.0), restarts=())
    drive = replace(still, command=drive.command[:steps], at=kept)
    forward, backward = (_change(law, effect, rig, drive, a) for a in (1.0, -1.0))
    shown = {n: _rms(v) / case.noise[n] for n, v in forward.items() if n in case.noise}
    channel = max(shown, key=lambda n: shown[n])
    odd, even = (_rms(forward[channel] + s * backward[channel]) for s in (-1.0, 1.0))
    share = even / max(odd + even, 1e-300)
    parity: Parity = "odd" if share < _ODD else "even" if share > _EVEN else "neither"
    sizes = [_rms(_change(law, effect, rig, drive, a)[channel]) for a in _SHARES]
    exponents = np.diff(np.log2(np.maximum(sizes, 1e-300)))
    whole = float(np.rint(exponents.mean()))
    power = whole if np.abs(exponents - whole).max() < _WHOLE else None
    return Claims(channel, parity, power, passive)


def _change(law: Law, effect: Effect, rig: Rig, drive: Drive, factor: float) -> Mapping[str, FloatArray]:
    """Return the change of every channel by the law, under the command times a factor."""
    scaled = replace(drive, command=factor * drive.command)
    setting = EffectSetting(effect.name, law.parameters)
    linear = rig.with_effects()
    without, with_it = (simulate_drive(r, scaled) for r in (linear, linear.with_effects(setting)))
    return {n: with_it[n] - without[n] for n in without}


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


_ITERATIONS = 12


@dataclass(frozen=True)
class Refined(Base):
    """A model with laws acting. ci95: of every unknown by name."""

    ci95: Mapping[str, tuple[float, float]]

    def parameters(self, name: str) -> dict[str, float]:
        """Return the parameters of one law, held ones included."""
        values = self.solution.values
        acting = next(e for e in self.solution.problem.rig.effects if e.name == name)
        return {n: values.get(f"{name}.{n}", v) for n, v in acting.parameters.items()}


def effect_from(source: str, name: str) -> Effect:
    """Return the effect of a text as a file's would be loaded."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.py"
        write_new(path, source)
        return plugin_constant("law", str(path), "EFFECT", Effect)


def refine(
    base: Base, weights: Score, laws: Sequence[tuple[Effect, Mapping[str, float]]],
    held: frozenset[str] = frozenset(),
) -> Refined:  # fmt: skip
    """Fit a base model's values and its laws' parameters to all blocks but the test blocks.

    weights: a score whose misfit counts as noise. held: parameters that stay as they are, as creep
    velocities do.
    """
    held |= {f"{e.name}.creep_velocity" for e, _ in laws}
    before = base.problem
    rig = before.rig.with_effects(*before.rig.effects, *(EffectSetting(e.name, dict(p)) for e, p in laws))
    more = [u for e, p in laws for u in unknowns_of_effect(e, p, held)]
    problem = replace(before, rig=rig, unknowns=(*before.unknowns, *more))
    start = np.concatenate([base.solution.theta, start_vector(more)])
    blocks = on_blocks(problem, base.cases, FITTED, weights, DEFAULT.blocks)
    solution = solve(blocks, start, iterations=_ITERATIONS, gain=1e-4)
    confidence = confidence_of(solution)
    sd = np.sqrt(np.diag(confidence.covariance))
    ci95 = {
        u.name: interval(u, float(at), float(s))
        for u, at, s in zip(solution.problem.unknowns, solution.theta, sd, strict=True)
    }
    return Refined(solution, base.cases, ci95)


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


def draft_of(law: Law) -> Draft:
    """Return a law with the effect of its file, which claims nothing yet."""
    source = source_of(law, Claims("velocity", "neither", None), _NO_PROVENANCE)
    return Draft(law, effect_from(source, law.name))


def finish_laws(
    drafts: Sequence[Draft], refined: Refined, provenance: LawProvenance | None, gain: float,
    ci95: tuple[float, float],
) -> list[WrittenLaw]:  # fmt: skip
    """Return the laws as they were fitted, with their files."""
    where = provenance or _NO_PROVENANCE
    held_out_gain = (
        f"Gain on blocks of time that took part in no fit and no choice: {100 * gain:.1f} % "
        f"(95 %: {100 * ci95[0]:.1f} to {100 * ci95[1]:.1f} %)."
    )
    written = []
    for draft in drafts:
        name = draft.effect.name
        values = refined.parameters(name)
        if not any(values[n] for n in _sizes(draft.law)):
            continue
        intervals = {n: refined.ci95[f"{name}.{n}"] for n in values if f"{name}.{n}" in refined.ci95}
        law = draft.law if draft.law.is_learnt else draft.law.with_parameters(values, intervals)
        shown = torque_points(refined, law, values)
        whole = len(law.parts) == len(draft.law.parts)
        effect = draft.effect if whole else draft_of(law).effect
        with lend(effect):
            claims = claims_of(law, effect, refined.rig, refined.cases[0])
        written.append(
            WrittenLaw(law, effect, source_of(law, claims, replace(where, gain=held_out_gain)), claims, shown)
        )
    return written


def torque_points(refined: Refined, law: Law, values: dict[str, float]) -> FigurePoints:
    """Return the missing torque of the fitted model without a law, over the law's variable."""
    off = {n: 0.0 if n in _sizes(law) else v for n, v in values.items()}
    problem, rig = refined.problem, refined.problem.rig
    others = [e if e.name != law.name else EffectSetting(law.name, off) for e in rig.effects]
    names = [i for i, u in enumerate(problem.unknowns) if not u.name.startswith(f"{law.name}.")]
    rest = replace(problem, rig=rig.with_effects(*others), unknowns=tuple(problem.unknowns[i] for i in names))
    theta = refined.solution.theta[names]
    model = case_model(rest, theta, rest.cases[0], rest.outputs(theta)[0], law.place)
    over = law.curve.over if law.curve is not None else _most(law)
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


def _most(law: Law) -> str:
    """Return the variable over which a law is drawn: that of its largest term."""
    used = letters_of(replace(law, parts=law.parts[:1]))
    return next((n for n in _FIRST if n in used), "t")
