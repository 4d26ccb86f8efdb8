"""A diagnosis in sentences and numbers: verdict, certainty, evidence, the next run; lines of a terminal."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from rich.text import Text

from rsea_ros.diagnosis import result as results
from rsea_ros.diagnosis.result import Alternative, Cause, Diagnosis, Experiment, Rejected
from rsea_ros.documents.units import in_motion
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.identification.result import is_unexcited, silent_channels
from rsea_ros.records.record import UNITS
from rsea_ros.report import remark_words as remarks, words
from rsea_ros.report.figures.spectrum import peak_above
from rsea_ros.report.words import LABEL, WIDTH, command_row, row, wrap

_REASONS: Mapping[results.Reason, str] = {
    "far_behind": "much worse than the best effect on the training data",
    "at_bound": "its fitted size is at the bound of the effect, or within a clock's error of nothing",
    "not_sure": "does not certainly lower the residual of held-out data",
    "too_small": "lowers the residual of held-out data, but by too little",
    "leaves_priors": "gains less than it costs to leave the rig's values so far outside their stated doubt",
    "explains_less": "{rival} explains more",
    "no_better_than_simpler": "no better than {rival}, which is simpler",
    "no_better_than_likelier": "no better than {rival}, which agrees better with the priors",
    "redundant": "not needed in addition to the other causes",
    "replaced": "replaced by another effect after later causes were added",
    "improbable": "helps, but its law does not fit the data: probability {probability:.2f}",
    "leaves_too_much": "helps, but leaves so much that it may replace another effect",
}
_CERTAINTY = {
    "confirmed": "the simulation certainly lacks it",
    "leading": "it certainly helps on held-out data, but part of the misfit remains",
    "one_of": "these data do not distinguish them",
}
_RESPECTS = {"frequency_band": "frequency", "amplitude": "load", "velocity": "speed", "angle": "rotor angle"}
_BY_THE_WAY = ("rate", "seed", "period")
"""Settings of an experiment that matter only to the command that plays it."""


def headline(diagnosis: Diagnosis) -> str:
    """Return the verdict as one short sentence, and how many values are not the rig's."""
    return "; ".join(filter(None, (_verdict(diagnosis)[0], remarks.values_off(diagnosis.remarks))))


def diagnosis_sentence(diagnosis: Diagnosis) -> str:
    """Return the verdict with its numbers, values that are not the rig's, and faults of the data."""
    off = words.sentence(remarks.values_off(diagnosis.remarks))
    return f"{_verdict(diagnosis)[1]}.{f' {off}.' if off else ''}{remarks.found_faults(diagnosis.faults)}"


def _verdict(d: Diagnosis) -> tuple[str, str]:
    """Return the verdict as a title, and as a sentence with numbers."""
    name, (before, after) = words.channel(d.channel), times_noise(d, d.channel)
    at_floor = f"re-fitted the {name} residual is at the noise floor ({after:.2f} times the noise)"
    silent = list_names([words.channel(n) for n in silent_channels(d.faults)])
    if d.verdict == "nothing_wrong" and is_unexcited(d.faults):
        text = "These data show nothing: the command never changes, so no cause could be seen"
        return text, text
    if d.verdict == "nothing_wrong":
        is_off = remarks.values_off(d.remarks)
        fine = "The structure of the {} fits" if is_off else "Nothing is wrong with the {}"
        title = f"{fine.format('simulation')}: with fitted values, {_noise_left(d, 'only sensor noise')}"
        return title, f"{fine.format('model')}: with its values {at_floor}"
    if d.verdict == "unexplained" and silent and d.at_noise_floor:
        title = f"{words.sentence(silent)} measures nothing; in the other channels only noise is left"
        return title, f"The {silent} measures nothing and is left out; with the model's values {at_floor}"
    if d.verdict == "unexplained":
        left = words.times(math.ceil(100.0 * before) / 100.0 if before < 2.0 else before)  # not to the floor
        size = f"The {name} residual is {left} times the noise"
        return f"{size}, and no effect of the catalogue explains it", f"{size}; no known effect explains it"
    explains, pronoun = ("explain", "them") if len(d.causes) > 1 else ("explains", "it")
    rest, part = _noise_left(d, "only noise"), "part" if after < before else "no part"
    if d.verdict == "explained":
        how, end = f"{explains} the misfit", ", which is the floor"
    elif d.at_noise_floor:
        how, end = f"probably {explains} the misfit", ", but another law may do the same"
    else:
        how, rest = f"{explains} {part} of the misfit", "the rest stays unexplained"
        end, worst = f"; {rest}", left_channel(d)
        if worst:
            times = words.times(times_noise(d, worst)[1])
            end = f"; the {words.channel(worst)} residual stays at {times} times the noise"
    left = f"{after:.2f}" if d.at_noise_floor or d.verdict == "explained" else words.times(after)
    named = list_names([words.effect(c.name) for c in d.causes])
    falls = f"falls from {words.times(before)} to {left}" if after < before else f"stays at {left}"
    fall = f"with {pronoun} the {name} residual {falls} times the noise"
    title = f"{cause_list(d.causes)} {how}; {rest}"
    return words.sentence(title), words.sentence(f"{named} {how}: {fall}{end}")


def _noise_left(d: Diagnosis, noise: str) -> str:
    """Return `only noise is left`, or where the figure below shows more than that."""
    for s in d.spectra:
        peak = peak_above(s.frequency, s.after if d.causes else s.before, s.noise)
        if s.channel == d.channel and peak:
            return f"little more than noise is left, at most {peak}"
    return f"{noise} is left"


def cause_list(causes: Sequence[Cause]) -> str:
    """Return causes with their main size: `Coulomb friction (3.00 N·m) and backlash (1.20 mrad)`.

    A size whose interval has both signs is open.
    """
    shown = []
    for cause in causes:
        name, p = next(iter(cause.parameters.items()))
        label = f"{name.replace('_', ' ')} " if p.unit == "1" else ""
        known = p.ci95[0] * p.ci95[1] >= 0.0 and p.ci95[0] < p.ci95[1] < math.inf
        size = f"{label}{words.quantity(p.value, p.unit, 3)}" if known else "size open"
        shown.append(f"{words.effect(cause.name)} ({size})")
    return list_names(shown)


def status_line(cause: Cause, alternatives: Sequence[Alternative] = (), at_floor: bool = False) -> str:
    """Return `leading: command_delay 9.10 ms [8.40, 9.80], probability 0.87; …` of a cause.

    alternatives: of the whole diagnosis. at_floor: the residual with all causes is noise.
    """
    rivals = [a for a in alternatives if a.instead_of == cause.name]
    rivals.sort(key=lambda a: -a.probability)
    named: list[Cause | Alternative] = [cause, *rivals]
    items = [f"{_size(item)}, probability {item.probability:.2f}" for item in named]
    reason = _CERTAINTY[cause.status]
    if at_floor and cause.status == "leading":
        reason = "it reduces the residual to the noise, but another law may do the same"
    if cause.status != "one_of" and cause.gain_holdout_ci95[0] <= 0.0:
        reason = "by itself it may gain nothing on held-out data"
    if cause.status == "one_of" and rivals:
        return f"one of: {list_names(items, 'or')}; {reason}"
    text = f"{cause.status.replace('_', ' ')}: {items[0]}; {reason}"
    return f"{text}; less likely instead: {list_names(items[1:], 'or')}" if rivals else text


def _size(item: Cause | Alternative) -> str:
    """Return name and main parameter with its 95 % interval: `command_delay 9.10 ms [8.40, 9.80]`."""
    if not item.parameters:
        return item.name
    p = next(iter(item.parameters.values()))
    factor, unit = words.unit_factor(p.value, p.unit)
    value, low, high = (words.number(v * factor) for v in (p.value, *p.ci95))
    return f"{item.name} {value}{f' {unit}' if unit else ''} [{low}, {high}]"


def evidence(cause: Cause) -> str:
    """Return the evidence for a cause as one sentence."""
    before, after = cause.times_noise
    moves = "falls" if after < before else "rises" if after > before else "stays"
    return (
        f"With {effect_named(cause.name).about}, the {words.channel(cause.channel)} residual of data that "
        f"took no part {moves} from {before:.2f} to {after:.2f} times the noise (gain "
        f"{words.minus(f'{100.0 * cause.gain_holdout:.1f}')} %)."
    )


def rejection(rejected: Rejected) -> str:
    """Return the reason for a rejection, as part of a sentence."""
    probability = rejected.probability or 0.0
    return _REASONS[rejected.reason].format(rival=rejected.rival, probability=probability)


def respect(quantity: str) -> str:
    """Return the plain name of the quantity of a residual profile."""
    return _RESPECTS.get(quantity, quantity.replace("_", " "))


def prose(text: str) -> str:
    """Return a sentence with plain names of effects, `coulomb_friction` as `Coulomb friction`."""
    return re.sub(r"[a-z]+(?:_[a-z]+)+", lambda match: words.effect(match[0]), text)


def confusions(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each cause that these data do not distinguish from others."""
    return [
        words.sentence(
            f"{words.effect(c.name)}: these data do not distinguish it from "
            f"{list_names([words.effect(n) for n in c.confusable_with], 'or')}."
        )
        for c in diagnosis.causes
        if c.confusable_with
    ]


def next_run(experiment: Experiment) -> str:
    """Return the question that a run would decide, or why none is recommended, without a full stop."""
    rivals = f"{experiment.cause} and {list_names(experiment.rivals)}"
    alike = f"{rivals} do as well on these data"
    if experiment.reason == "other_amplitude":
        return f"{alike}; a run at another amplitude would show more"
    if experiment.reason == "separates":
        return f"{alike}; this run makes them differ by {experiment.separation:.1f} times the noise"
    if experiment.reason == "inseparable":
        return (
            f"{rivals} make the same motion under every excitation tried within the limits of rig and driver "
            f"(at most {experiment.separation:.2f} times the noise apart): only a separate measurement "
            "distinguishes them, such as the spring stiffness by a known weight"
        )
    multisine = " with an odd multisine, whose empty lines show distortion apart from noise"
    amplitude = {0.5: "half", 2.0: "twice"}[experiment.amplitude]
    return (
        f"nothing in the catalogue explains what is left: repeat at {amplitude} the "
        f"amplitude{multisine if experiment.excitation else ''}; what scales with the command is linear, "
        "what does not is friction-like"
    )


def excitation(settings: Mapping[str, float | str]) -> str:
    """Return `chirp, amplitude 64.3 N·m, 0.05 to 120 Hz, 12 s` of an experiment."""
    known = {k: v if isinstance(v, str) else f"{v:.3g}" for k, v in settings.items() if k not in _BY_THE_WAY}
    parts = [known.pop("kind", "")]
    torque = words.unit(known.pop("unit", "N m"))
    parts += [f"{k} {known.pop(k)} {torque}" for k in ("amplitude", "noise", "peak") if k in known]
    if {"low", "high"} <= set(known):
        parts.append(f"{known.pop('low')} to {known.pop('high')} Hz")
    parts += [f"{known.pop('duration')} s"] if "duration" in known else []
    return ", ".join(filter(None, [*parts, *(f"{k.replace('_', ' ')} {v}" for k, v in known.items())]))


_END = 0.99
"""Share of the upper bound from which a value stands for infinity."""


def times_noise(diagnosis: Diagnosis, channel: str) -> tuple[float, float]:
    """Return the held-out residual of a channel over its noise, before and after."""
    noise = diagnosis.noise_rms.get(channel, np.nan) or np.nan
    return diagnosis.residual_rms[channel] / noise, diagnosis.extended_residual_rms[channel] / noise


def left_channel(diagnosis: Diagnosis) -> str:
    """Return the worst channel above the noise where the main one has reached it; empty for none."""
    after = {n: times_noise(diagnosis, n)[1] for n in diagnosis.extended_residual_rms}
    reached = diagnosis.settings.floor.reached
    if diagnosis.at_noise_floor or not after[diagnosis.channel] <= reached:
        return ""
    worst = max(after, key=lambda n: after[n] if after[n] > reached else 0.0)
    return worst if after[worst] > reached else ""


def percent(share: float) -> str:
    """Return a share as `97.3 %`, with a minus sign that is one; below −100 % as `< −100 %`."""
    return f"{_percents(share)} %" if np.isfinite(share) else "–"


def _percents(share: float) -> str:
    """Return a share in percent; a residual that more than doubles is no gain, whatever its size."""
    return words.minus(f"{100.0 * share:.1f}" if share >= -1.0 else "< -100")


def percent_range(interval: tuple[float, float]) -> str:
    """Return an interval of shares as `97.1 to 97.5 %`."""
    low, high = map(_percents, interval)
    return f"{low} to {high} %"


def residual_change(diagnosis: Diagnosis, channel: str) -> str:
    """Return `36.8 → 0.99`: the residual over the noise, before and after; once where nothing has changed."""
    before, after = (words.number(v, 3 if v >= 1.0 else 2) for v in times_noise(diagnosis, channel))
    return f"{before} → {after}" if diagnosis.causes else before


def sizes(cause: Cause) -> dict[str, results.CauseParameter]:
    """Return the parameters that say how large a cause is.

    One that would be infinite is left out: a drift that is a straight line has no time constant.
    """
    effect = catalogue().get(cause.name)
    ends = {p.name: p.high for p in effect.parameters if p.optional and math.isinf(p.null)} if effect else {}
    return {n: p for n, p in cause.parameters.items() if p.value < _END * ends.get(n, math.inf)}


_STYLES = {"partly_explained": "bold yellow", "unexplained": "bold red"}
_MOST = 3


def tried(diagnosis: Diagnosis) -> str:
    """Return `31 of the catalogue's 33 causes`: the others cannot act on this rig, or were left out."""
    return f"{len(diagnosis.causes) + len(diagnosis.rejected)} of the catalogue's {len(catalogue())} causes"


def fitted_rivals(diagnosis: Diagnosis) -> list[Rejected]:
    """Return the effects that were fitted to all training data and rejected, largest gain first."""
    fitted = (r for r in diagnosis.rejected if r.is_fitted)
    return sorted(fitted, key=lambda r: -r.gain_holdout if math.isfinite(r.gain_holdout) else math.inf)


def terminal_lines(diagnosis: Diagnosis, width: int = WIDTH) -> list[Text]:
    """Return the verdict and the evidence, each in lines of at most `width` columns."""
    d, (off, others) = diagnosis, remarks.split_off_rig(diagnosis.remarks)
    style = _STYLES.get(d.verdict, "bold yellow" if off else "bold green")
    rows = [row("rig", remarks.rig_named(d.rig_name, d.rig_choice), width)]
    rows += [row("", sentence, width) for sentence in remarks.remark_sentences(off)]
    if off:  # what speaks against the rig
        again = remarks.command("identify", d.sources, d.rig_name, d.rig_choice)
        rows.append(command_row("", remarks.right_rig(), again, width))
    stated = [r for r in others if r.code == "differs"]
    rows += [row("record", sentence, width) for sentence in remarks.remark_sentences(stated)]
    unclear = remarks.remark_sentences(r for r in others if r not in stated)
    rows += [row(name, text, width) for name, text in _rows(d, unclear)]
    shown = (Text.assemble((text[:LABEL], "dim"), text[LABEL:]) for text in rows)
    return [Text(wrap(headline(d), width), style=style), *shown]


def inspection(name: str) -> str:
    """Return what a mechanic looks at where a cause is named; empty for an effect that does not say it."""
    return effect_named(name).inspect if name in catalogue() else ""


_EDITED = {
    "survived": "survives its removal",
    "still_there": "is still in the edited machine",
    "worse": "does not survive its removal, or more was changed",
    "undecided": "cannot be judged: something else differs, or this is another machine",
}


def edit_sentence(e: results.Edit) -> str:
    """Return what a run of the edited machine says of a name."""
    errors = (e.error_after, e.error_before, e.error_dense_fit, e.own_error)
    after, before, dense, own = (words.times(error / e.noise) for error in errors)
    return (
        f"{words.effect(e.cause)} {_EDITED[e.outcome]}. Deleted from the model, nothing fitted, the error of "
        f"the {words.channel(e.channel)} of the edited machine is {after} times the noise ({own} on its own "
        f"machine); with it {before}, of the rig fitted without causes {dense}"
    )


def size_text(s: results.SmallestChange) -> str:
    """Return the size of the smallest change with its unit; no size shows where a fit answers it."""
    digits = 4 if abs(s.value - 1.0) < 0.1 else 2  # a gain
    return words.quantity(s.value, s.unit, digits) if math.isfinite(s.value) else "at no size"


def _rows(d: Diagnosis, unclear: Sequence[str]) -> Iterator[tuple[str, str]]:
    main = d.channel
    unit = in_motion(UNITS[main], linear=d.baseline_rig.linear)
    levels = (d.residual_rms, *([d.extended_residual_rms] if d.causes else []))
    rms, noise = (words.quantity(v[main], unit) for v in levels), words.quantity(d.noise_rms[main], unit)
    change = f"{residual_change(d, main)} times the noise ({' → '.join(rms)}, noise {noise})"
    yield "residual", f"{words.channel(main)} {change}"
    if left := left_channel(d):
        yield "", f"{words.channel(left)} {residual_change(d, left)} times the noise"
    for cause in d.causes:
        texts = {n: words.measured_text(p.value, *p.ci95, p.unit) for n, p in sizes(cause).items()}
        shown = ", ".join(f"{name} {text}" for name, text in texts.items()).replace("_", " ")
        yield "cause", f"{cause.name}: {shown}"
        gain, interval = percent(cause.gain_holdout), percent_range(cause.gain_holdout_ci95)
        yield "gain", f"{gain} of the {words.channel(cause.channel)} residual, held out (95 %: {interval})"
        yield "status", status_line(cause, d.alternatives, d.at_noise_floor)
    if d.edit is not None:
        yield "edited", edit_sentence(d.edit)
    if d.smallest:
        every = [f"{s.name} {size_text(s)}" for s in d.smallest if math.isfinite(s.value)]
        yield "would show", ", ".join(every).replace("_", " ")
    if d.misfit and d.verdict != "nothing_wrong":
        worst: dict[str, results.Misfit] = {}  # in each respect
        for m in sorted(d.misfit, key=lambda m: -m.times_noise):
            worst.setdefault(m.what, m)
        where = [
            f"{respect(m.what)} {words.span(m.low, m.high, m.unit)} ({words.times(m.times_noise)} times)"
            for m in worst.values()
        ]
        yield "wrong at", "; ".join(where[:_MOST])
    for rival in fitted_rivals(d)[:_MOST]:
        yield "rejected", f"{rival.name}: {prose(rejection(rival))}"
    if d.rejected:
        yield "tried", tried(d)
    for sentence in (*confusions(d), *unclear):
        yield "unclear", sentence
    if (following := d.next_experiment) is not None:
        settings = excitation(following.excitation)
        run = f"{prose(next_run(following))}{f': {settings}' if settings else ''}"
        yield "next run" if following.excitation else "decides", run
    for line in remarks.fault_lines(d.faults):
        yield "data", line
