"""Laws learnt from records: regression, choice, fit in the simulation; effect files and their claims."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rsea_ros.diagnosis.candidate import on_blocks
from rsea_ros.diagnosis.criteria import is_at_floor
from rsea_ros.diagnosis.data_split import TEST
from rsea_ros.diagnosis.score import Score, gain_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import lend
from rsea_ros.effects.effect import Claims, Effect, Parity
from rsea_ros.identification.confidence import confidence_of, interval
from rsea_ros.identification.problem import Case
from rsea_ros.identification.solver import one_blas_thread, solve
from rsea_ros.identification.unknowns import start_vector, unknowns_of_effect
from rsea_ros.laws import choice as choices, law as forms
from rsea_ros.laws.candidates import SPLINES, basis_of, spline_knots
from rsea_ros.laws.effect_source import LawProvenance, source_of
from rsea_ros.laws.sparse_regression import SELECTION, Dependence, SparseLaw, dependences
from rsea_ros.laws.variables import CaseModel, case_model
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.outputs.files import write_new
from rsea_ros.plugins import plugin_constant
from rsea_ros.progress import Progress
from rsea_ros.records.record import FloatArray, Record

_LONGEST = 10.0
"""s of the record that are simulated."""
_WHOLE = 0.12
"""How near to a whole number an exponent must be, at every amplitude, to be one."""
_SHARES = (0.3, 0.6, 1.2)
"""Of the record's amplitude."""
_ODD, _EVEN = 1e-7, 0.95


def claims_of(law: forms.Law, effect: Effect, rig: Rig, case: Case) -> Claims:
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


def _change(
    law: forms.Law, effect: Effect, rig: Rig, drive: Drive, factor: float
) -> Mapping[str, FloatArray]:
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
class Refined(choices.Base):
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
    base: choices.Base, weights: Score, laws: Sequence[tuple[Effect, Mapping[str, float]]],
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
    blocks = on_blocks(problem, base.cases, choices.FITTED, weights, DEFAULT.blocks)
    solution = solve(blocks, start, iterations=_ITERATIONS, gain=1e-4)
    confidence = confidence_of(solution)
    sd = np.sqrt(np.diag(confidence.covariance))
    ci95 = {
        u.name: interval(u, float(at), float(s))
        for u, at, s in zip(solution.problem.unknowns, solution.theta, sd, strict=True)
    }
    return Refined(solution, base.cases, ci95)


_DRAWN = 4000
"""Of the missing torque that are drawn."""
LAW = "law"
"""What a law of a past is drawn over: its own value, for no variable of the moment tells it."""
_FIRST = ("theta", "h", "d", "w", "u", "T", "q", "t", "share")
_NO_PROVENANCE = LawProvenance("an unknown date", "0", {"unknown": "0"}, "")


@dataclass(frozen=True)
class Draft:
    """A law with the effect that its file makes, before the fit."""

    law: forms.Law
    effect: Effect


def draft_of(law: forms.Law) -> Draft:
    """Return a law with the effect of its file, which claims nothing yet."""
    source = source_of(law, Claims("velocity", "neither", None), _NO_PROVENANCE)
    return Draft(law, effect_from(source, law.name))


def finish_laws(
    drafts: Sequence[Draft], refined: Refined, provenance: LawProvenance | None, gain: float,
    ci95: tuple[float, float],
) -> list[forms.WrittenLaw]:  # fmt: skip
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
        source = source_of(law, claims, replace(where, gain=held_out_gain))
        written.append(forms.WrittenLaw(law, effect, source, claims, shown))
    return written


def torque_points(refined: Refined, law: forms.Law, values: dict[str, float]) -> forms.FigurePoints:
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
    inside = np.linspace(0.02, 0.98, min(_DRAWN, len(t))) * (len(t) - 1)
    k = np.unique(inside.astype(np.int64))
    course = law.values(model.variables) * (values.get("size", 1.0))
    if law.parts and law.parts[0].term.memory:
        over, letters = LAW, {**letters, LAW: course}
    return forms.FigurePoints(
        t=t[k], x=np.interp(t[k], at, letters[over]), values=model.missing.torque[k],
        law=np.interp(t[k], at, course), over=over, sd=model.missing.sd,
    )  # fmt: skip


def _sizes(law: forms.Law) -> set[str]:
    return {"size"} if law.is_learnt else {c for c, _ in law.names}


def _most(law: forms.Law) -> str:
    """Return the variable over which a law is drawn: that of its largest term."""
    used = forms.letters_of(replace(law, parts=law.parts[:1]))
    return next((n for n in _FIRST if n in used), "t")


_NEEDED = 0.03
"""Of what is left: a term without which the fit leaves no more than that is left out."""


def refined_laws(base: choices.Base, drafts: Sequence[Draft]) -> Refined:
    """Fit the laws in the simulation, in units of their residual, and drop needless terms."""
    starts = [(d.effect, d.law.parameters) for d in drafts]
    refined = refine(base, base.score(choices.FITTED), starts)
    weights = refined.score(choices.FITTED)
    refined = _again(base, drafts, refined, weights, frozenset())
    held: frozenset[str] = frozenset()
    while (names := _least(drafts, refined, held)) is not None:
        fewer = _again(base, drafts, refined, weights, held | names)
        if fewer.solution.cost > (1.0 + _NEEDED) * refined.solution.cost:
            break
        refined, held = fewer, held | names
    return refined


def _again(
    base: choices.Base, drafts: Sequence[Draft], refined: Refined, weights: Score, held: frozenset[str]
) -> Refined:
    """Fit from a fit on, with some parameters held: coefficients at zero, shapes where they are."""
    nearer = replace(base.solution, theta=refined.solution.theta[: len(base.solution.theta)])
    base = replace(base, solution=nearer)
    starts = [
        (e, refined.parameters(e.name) | {n: 0.0 for n, _ in law.names if f"{e.name}.{n}" in held})
        for e, law in ((d.effect, d.law) for d in drafts)
    ]
    return refine(base, weights, starts, held)


def _least(drafts: Sequence[Draft], refined: Refined, held: frozenset[str]) -> frozenset[str] | None:
    """Return the parameters of the term of least significance, its shape too where no other has it."""
    terms = [
        (d.effect.name, c, s) for d in drafts for c, s in d.law.names if f"{d.effect.name}.{c}" not in held
    ]
    if len(terms) < 2:
        return None

    def significance(term: tuple[str, str, str]) -> float:
        name = f"{term[0]}.{term[1]}"
        low, high = refined.ci95[name]
        return abs(refined.solution.values[name]) / max(high - low, 1e-300)

    effect, c, s = min(terms, key=significance)
    shared = any(other != c and shape == s for e, other, shape in terms if e == effect)
    return frozenset({f"{effect}.{c}", *([f"{effect}.{s}"] if s and not shared else [])})


def share_of(before: dict[str, float], after: dict[str, float], noise: dict[str, float]) -> float:
    """Return the explained share of the power above the noise, over the channels that had any."""
    shares = [
        ((before[n] ** 2 - after[n] ** 2), before[n] ** 2 - noise[n] ** 2)
        for n in before
        if before[n] > DEFAULT.floor.reached * noise[n]
    ]
    return sum(a / b for a, b in shares) / len(shares) if shares else 0.0


_POINTS = 41
"""Of a learnt curve, evenly apart."""
_RIDGE = 1e-4


def law_of(search: choices.Search, models: Sequence[SparseLaw]) -> list[forms.Law]:
    """Return the laws of some models fitted together, those of one place as one."""
    gram, candidates, first = search.gram, search.candidates, len(search.gram.prior)
    columns = [k for m in models for k in m.columns]
    if not columns:
        return []
    beta = gram.fit(np.array(columns, np.int64), SELECTION)[first:]
    parts: dict[str, list[forms.FittedTerm]] = {}
    for k, b in zip(columns, beta, strict=True):
        candidate = candidates[k - first]
        assert candidate.term is not None
        parts.setdefault(candidate.place, []).append(
            forms.FittedTerm(candidate.term, float(b / gram.scale[k]), candidate.shape)
        )
    laws = []
    for place, items in parts.items():
        regressor = list_names(list(dict.fromkeys(p.term.regressor for p in items)))
        name = _name_with_place(f"law_of_{_slug(items[0].term.regressor)}", place)
        law = forms.Law(name, items[0].term.place, regressor, tuple(items), {})
        laws.append(_with_ranges(law, search.cases))
    return laws


def curve_of(search: choices.Search, dependence: Dependence) -> forms.Law:
    """Return the learnt law of a dependence: its spline, as points of a curve."""
    gram, candidates, first = search.gram, search.candidates, len(search.gram.prior)
    place = dependence.place
    columns = [first + k for k, c in enumerate(candidates)
               if c.part and (c.place, c.regressor) == (place, dependence.regressor)]  # fmt: skip
    beta = gram.fit(np.array(columns), SELECTION, _RIDGE)[first:] / gram.scale[columns]
    spline = next(s for s in SPLINES if (s.place, s.regressor) == (place, dependence.regressor))
    knots = spline_knots(search.cases, spline)
    x = np.linspace(knots[0], knots[-1], _POINTS)
    used = [c.part[2] for k in columns if (c := candidates[k - first]).part]
    curve = forms.LearntCurve(spline.over, spline.factor, x, beta @ basis_of(x, knots)[used])
    name = _name_with_place(f"learnt_law_of_{_slug(dependence.regressor)}", place)
    return _with_ranges(forms.Law(name, place, dependence.regressor, (), {}, curve), search.cases)


def _with_ranges(law: forms.Law, cases: Sequence[CaseModel]) -> forms.Law:
    by_case = [c.variables.letters for c in cases]
    read = [n for n in forms.READS if n in forms.letters_of(law)]
    largest = {n: float(np.max(np.abs(np.concatenate([each[n] for each in by_case])))) for n in read}
    return replace(law, ranges=largest)


def _slug(text: str) -> str:
    words = text.replace("'s", "").replace(",", "").replace(" at the ", " ").replace("the ", "").split()
    return "_".join(w for w in words if w != "a").replace("sensor_sensor", "sensor")


def _name_with_place(name: str, place: str) -> str:
    return name if place == "gear" or name.endswith(place) else f"{name}_at_{place}"


def learn(
    records: Sequence[Record],
    rig: Rig,
    provenance: LawProvenance | None = None,
    progress: Progress | None = None,
) -> forms.LawResult:
    """Return the laws that a rig's simulation of records lacks, with their effect files.

    Raises IdentificationError when the records are too short or lack a channel that the rig needs.
    """
    tell = progress or (lambda step, share: None)
    with one_blas_thread():
        tell("fitting the model", 0.0)
        base = choices.fitted_base(records, rig)
        if is_at_floor(base.score(TEST)):
            return nothing_left(base, records)
        tell("looking for what is missing", 0.2)
        search = choices.make_search(base)
        tell("comparing laws", 0.6)
        depends = dependences(search.gram, search.candidates)
        models = choices.chosen_models(search, depends)
        taken = [k for m in models.taken for k in m.columns]
        depends = dependences(search.gram, search.candidates, taken) if taken else depends
        tell("fitting the law in the simulation", 0.75)
        return _result(search, depends, models, records, provenance)


def nothing_left(base: choices.Base, records: Sequence[Record]) -> forms.LawResult:
    """Return the result where the base model is at the noise floor."""
    (before, noise), rig = base.levels(), base.rig
    duration = sum(c.duration for c in base.cases)
    return forms.LawResult(rig.name, tuple(r.source for r in records), duration, rig, rig,
                     (), (), (), 0.0, (0.0, 0.0), 0.0, before, before, noise, at_floor=True)  # fmt: skip


def _result(
    search: choices.Search, depends: Sequence[Dependence], choice: choices.Choice, records: Sequence[Record],
    provenance: LawProvenance | None,
) -> forms.LawResult:  # fmt: skip
    base = search.base
    laws = law_of(search, choice.taken)
    if choice.curve is not None:
        laws = [curve_of(search, choice.curve)]
    drafts = [draft_of(law) for law in laws]
    with lend(*(d.effect for d in drafts)):
        refined = refined_laws(base, drafts) if drafts else None
        left = base.score(TEST)
        gain, ci95 = (
            gain_of(refined.score(TEST).loss(left), left.loss(left)) if refined else (0.0, (0.0, 0.0))
        )
        if refined is None or not (gain >= choices.MATTERS and ci95[0] > 0.0):
            return replace(nothing_left(base, records), dependences=tuple(depends), at_floor=False,
                           tried=choices.summarize_models(search, choice, ()))  # fmt: skip
        (before, noise), (after, _) = base.levels(), refined.levels()
        written = finish_laws(drafts, refined, provenance, gain, ci95)
        rigs = base.rig, refined.rig
    acting = {e.name for e in rigs[0].effects}
    with_files = (EffectSetting(w.law.name, w.law.parameters) for w in written)
    return forms.LawResult(
        rig_name=rigs[0].name, sources=tuple(r.source for r in records),
        duration=sum(c.duration for c in base.cases), base_rig=rigs[0],
        rig=rigs[1].with_effects(*(e for e in rigs[1].effects if e.name in acting), *with_files),
        dependences=tuple(depends), tried=choices.summarize_models(search, choice, choice.taken),
        laws=tuple(written), gain=gain, gain_ci95=ci95, share=share_of(before, after, noise),
        before=before, after=after, noise=noise, at_floor=False,
    )  # fmt: skip
