"""A designed run and a session of runs: page, figures, sentences and experiment.json."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.experiment.advice import Advice, Proof
from rsea_ros.experiment.campaign import Campaign, CampaignOutcome
from rsea_ros.experiment.hypothesis import NOTHING, Hypothesis
from rsea_ros.experiment.joint_weighing import RunWeighing
from rsea_ros.experiment.proposal import LEVEL, Proposal
from rsea_ros.experiment.run_shape import UNITS, RunLimits, run_text
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.files import NewFiles, check_free
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.figures.spectrum import in_bands
from rsea_ros.report.page import Block, Html, bullets, key_numbers, page, section, table
from rsea_ros.report.result_files import EXPERIMENT_JSON, MODEL, REPORT, Provenance, json_text, pick, strict

_COLOURS = (fig.AFTER, fig.BEFORE, fig.TRUTH, "#862e9c", "#5c940d", "#0b7285")
_DASH = ("solid", "dash", "dot", "dashdot")
_SHOWN, _ROWS = 0.02, 8
"""Causes of a session that the page shows: the probability at least, and how many in a row of the table."""


def check_session_free(out: Path) -> None:
    """Refuse, before any run, a folder that holds files of a session: no run is played and then lost.

    Raises OutputError for the first of them.
    """
    check_free([*(out / name for name in (EXPERIMENT_JSON, MODEL, REPORT)), *sorted(out.glob("run-*"))])


def write_campaign(outcome: CampaignOutcome, campaign: Campaign, out: Path) -> Path:
    """Write experiment.json, model.yaml, report.html and the commands; return the report's path.

    model.yaml: the rig with the likeliest cause and the values of all records together.
    """
    with NewFiles(out) as new:
        for k, p in _played(outcome):
            new.write(f"run-{k}.csv", run_text(p.command, p.rate))
        new.write(EXPERIMENT_JSON, json_text(campaign_json(outcome, campaign)))
        new.write(MODEL, rig_text(outcome.weighing.hypotheses()[0].rig))
        title = words.sentence(end_sentence(outcome))
        kicker = f"A session of experiments · {campaign.rig.name}"
        return new.write(REPORT, page(title, kicker, _session(outcome, campaign.asked.limits)))


def _played(outcome: CampaignOutcome) -> list[tuple[int, Proposal]]:
    return [(k, r.proposal) for k, r in enumerate(outcome.rounds, 1) if r.proposal is not None]


def advice_page(advice: Advice, provenance: Provenance | None = None) -> str:
    """Return the page of an offline design."""
    kicker = f"The next experiment · {advice.hypotheses[0].problem.rig.name}"
    return page(verdict(advice), kicker, _advice(advice), (), provenance)


def _advice(advice: Advice) -> Iterator[Block]:
    p = advice.proposal
    if p is not None:
        keys = [
            (f"{p.duration:.3g} s", "of excitation"),
            (f"{p.peaks.at_level['torque']:.3g} N·m", "largest torque"),
        ]
        if p.worst is not None:
            true, rival, s = p.worst
            keys.append((f"{s:.3g}", f"S of {plain_name(true)} over {plain_name(rival)}, the worst pair"))
        yield key_numbers(
            keys if len(p.names) == 1 else [*keys, (f"{100.0 * p.decided:.0f} %", "expected to be decided")]
        )
    yield section("Still possible", table(("cause", "how sure"), possible_rows(advice)))
    if p is not None:
        yield from [_separations(p)] if len(p.names) > 1 else []
        yield command_figure(p)
        yield spectrum_figure([("run", p)])
        yield _demands(p, advice.asked.limits)
    if advice.proofs:
        yield section("Not separable by any run", bullets(map(proof_words, advice.proofs)))


def _separations(p: Proposal) -> Html:
    def number(value: float) -> str:
        return f"{value:.2g}" if value < 1e4 else f"{value:.0e}"

    rows = [
        (plain_name(a), *("" if a == b else number(p.table[i, j]) for j, b in enumerate(p.names)))
        for i, a in enumerate(p.names)
    ]
    caption = (
        "S, row true, column its rival: twice the expected gain of the logarithm of the odds after the rival "
        "has been fitted to the run. 6 makes odds of twenty to one."
    )
    head = ("true \\ rival", *(f"#{plain_name(n)}" for n in p.names))
    return section("Causes that the run separates", table(head, rows), caption=caption)


def _demands(p: Proposal, limits: RunLimits) -> Html:
    rows = table(
        ("quantity", "#expected", "#at level", "#limit", "unit"), limit_rows(p, limits.finite_limits())
    )
    return section("Demands on the bench", rows, caption=f"At level: {LEVEL_WORDS}.")


def command_figure(p: Proposal) -> fig.Figure:
    """Return the command over time."""
    t = np.arange(len(p.command)) / p.rate
    drawn = fig.line(t, p.command, "command", fig.AFTER, 1.0, hovertemplate="%{y:.3g} N·m")
    plane = fig.layout(xaxis=fig.axis("time, s"), yaxis=fig.axis("torque, N·m"))
    caption = "Commanded motor torque at the gear output; it begins and ends at zero under a raised cosine."
    return fig.Figure(f"The run: {shape_words(p)}", caption, [drawn], plane, 300)


def spectrum_figure(runs: Sequence[tuple[str, Proposal]]) -> fig.Figure:
    """Return the amplitude spectral densities of runs."""
    traces = []
    for k, (name, p) in enumerate(runs):
        f, density = density_of(p.command, p.rate)
        colour = (fig.AFTER, fig.BEFORE, fig.QUIET)[k % 3]
        hover = "%{y:.3g} N·m/√Hz"
        traces.append(fig.line(f, density, name, colour, 1.4, _DASH[k % 4], hovertemplate=hover))
    top = float(np.log10(max(y for trace in traces for y in trace["y"])))
    height = fig.axis("N·m/√Hz", type="log", range=[top - 3.0, top + 0.3])
    title = "Where the runs put their power" if len(runs) > 1 else "Where the run puts its power"
    names = fig.names_beside(fig.named(traces), 0.075)
    drawing = fig.layout(xaxis=fig.frequency_axis(0.2, 140.0), yaxis=height, annotations=names)
    return fig.Figure(title, "Amplitude spectral density of the command.", traces, drawing, height=320)


def density_of(command: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return frequency (Hz) and amplitude spectral density (N m/sqrt(Hz)) of a command, in narrow bands."""
    density = np.asarray(np.abs(np.fft.rfft(command)) * np.sqrt(2.0 / (rate * len(command))), float)
    frequency = np.asarray(np.fft.rfftfreq(len(command), 1.0 / rate), float)
    return in_bands(frequency[1:], density[1:])


def _session(outcome: CampaignOutcome, limits: RunLimits) -> Iterator[Block]:
    weighing, played = outcome.weighing, _played(outcome)
    yield key_numbers([
        (words.probability(weighing.probability[outcome.cause]), plain_name(outcome.cause)),
        (f"{outcome.seconds:.3g} s", "of excitation"),
        run_count(outcome),
        (f"{weighing.left:.2f}", "times the noise remains"),
    ])  # fmt: skip
    yield probability_figure(outcome)
    rows = []
    for k, r in enumerate(outcome.rounds):
        order = by_probability(r.weighing, _SHOWN)
        possible = ", ".join(f"{plain_name(n)} {p:.2f}" for n, p in order[:_ROWS])
        run = f"{shape_words(r.proposal)}; {r.proposal.resolved:.0%} expected" if r.proposal else ""
        rows.append((f"run {k}" if k else "first records", possible, size(r.weighing, order[0][0]), run))
    yield section("Run by run", table(("after", "possible", "size of the likeliest", "next run"), rows))
    if played:
        yield spectrum_figure([(f"run {k}", p) for k, p in played])
        yield from (command_figure(p) for _, p in played)
        yield _demands(played[-1][1], limits)
    if outcome.proofs:
        yield section("Not separable by any run", bullets(map(proof_words, outcome.proofs)))


def probability_figure(outcome: CampaignOutcome) -> fig.Figure:
    """Return the probability of each cause before the first run and after each."""
    rounds = [r.weighing.probability for r in outcome.rounds]
    x = np.arange(len(rounds), dtype=float)
    shown = {n for r in rounds for n, p in r.items() if p >= _SHOWN}
    names = sorted(shown, key=lambda n: (-rounds[-1].get(n, 0.0), n))
    traces = []
    for k, name in enumerate(names):
        colour = _COLOURS[k] if k < len(_COLOURS) else fig.QUIET
        y, dot = np.array([r.get(name, 0.0) for r in rounds]), {"size": 7, "color": colour}
        hover: fig.Json = {"mode": "lines+markers", "marker": dot, "hovertemplate": "probability %{y:.3f}"}
        traces.append(fig.line(x, y, plain_name(name), colour, 2.2, **hover))
    ticks = ["first records" if not k else f"after run {k}" for k in range(len(rounds))]
    drawing = fig.layout(
        xaxis=fig.axis(tickvals=fig.numbers(x), ticktext=ticks, range=[-0.2, float(x[-1]) + 0.2]),
        yaxis=fig.axis("probability", range=[-0.03, 1.06]),
        annotations=fig.names_beside(fig.named(traces), 0.075),
        margin={"l": 64, "r": 180, "t": 12, "b": 48},
    )
    caption = (
        "Probability of each cause by all records up to there. Each cause weighed here is as likely as any "
        "other before the first record."
    )
    return fig.Figure("Remaining causes after each run", caption, traces, drawing, height=360)


_NARROWER = 1.01
"""Factor below which a run does not narrow an interval."""
LEVEL_WORDS = (
    f"the upper limit at a probability of {LEVEL:.5f}, over the causes still possible and what is known of "
    "their numbers, to first order"
)


def plain_name(name: str) -> str:
    """Return the name of a cause for a sentence."""
    return "no cause at all" if name == NOTHING else words.effect(name)


def shape_words(p: Proposal) -> str:
    """Return the shape of a run in words: `multisine 0.5 to 42 Hz, 0.5 s, up to 18 N·m`."""
    s = p.shape
    band = f" {s.low:.2g} to {s.high:.3g} Hz" if s.kind in ("multisine", "chirp") else f" of {s.hold:.2g} s"
    bias = f" around {words.number(float(p.command.mean()), 2)} N·m" if abs(s.bias) > 0.02 else ""
    return f"{s.kind}{band}{bias}, {p.duration:.3g} s, up to {p.peaks.at_level['torque']:.3g} N·m"


def verdict(advice: Advice) -> str:
    """Return the answer in a sentence."""
    p = advice.proposal
    names = [plain_name(h.name) for h in advice.hypotheses]
    if p is None:
        return f"No run within the limits separates {list_names(names)}"
    if len(names) == 1:
        return f"{_narrowing(advice.hypotheses[0], p)}: {shape_words(p)}"
    between, share = list_names(names), f"{100.0 * p.decided:.0f} %"
    return f"The next run is expected to decide between {between} in {share} of cases: {shape_words(p)}"


def possible_rows(advice: Advice) -> list[tuple[str, str]]:
    """Return each cause and how sure it is beside the others; one alone has no rival here."""
    sure = [f"probability {words.probability(h.probability)} among these" for h in advice.hypotheses]
    sure = sure if len(sure) > 1 else ["no rival given"]
    rows = [(h.name, text) for h, text in zip(advice.hypotheses, sure, strict=True)]
    rows += [(n, f"excluded by the records: probability {p:.1g}") for n, p in advice.excluded.items()]
    return [(plain_name(name), text) for name, text in rows]


def _narrowing(hypothesis: Hypothesis, p: Proposal) -> str:
    """Return how much a run narrows each interval where one cause is left: the geometric mean over them."""
    if hypothesis.name == NOTHING:
        return "No cause is in doubt; a run can only narrow the intervals of the rig, and this one does most"
    count = len(hypothesis.cause_indices) or len(hypothesis.theta)
    if math.exp(p.sharpened / count) < _NARROWER:
        return f"No run within the limits narrows the intervals of {plain_name(hypothesis.name)}; the best"
    times = f"{math.exp(p.sharpened / count):.3g} times"
    if count == 1:
        return f"The next run narrows the interval of {plain_name(hypothesis.name)} {times}"
    return f"The next run narrows the intervals of {plain_name(hypothesis.name)} {times} on average"


def proof_words(proof: Proof) -> str:
    """Return why no run separates a pair, and which measurement would."""
    b = proof.bound
    low, high = b.frequency[0], b.frequency[-1]
    head = (
        f"{plain_name(b.true)} and {plain_name(b.rival)}: no run of {b.duration:.0f} s with a spectrum in "
        f"{low:.2g} to {high:.3g} Hz within the limits separates them by more than S = {b.most:.2g} (6 makes "
        "odds of twenty to one)"
    )
    return f"{head}. Measure separately: {'; or '.join(a.what for a in proof.apart)}."


def limit_rows(p: Proposal, stated: dict[str, float]) -> list[tuple[str, str, str, str, str]]:
    """Return each quantity: expected, at the level that is stated, limit, unit."""
    limit = {n: f"{stated[n]:.4g}" if n in stated else "none" for n in UNITS}
    return [
        (n, f"{p.peaks.expected[n]:.4g}", f"{p.peaks.at_level[n]:.4g}", limit[n], plain(unit))
        for n, unit in UNITS.items() if n in p.peaks.expected
    ]  # fmt: skip


def known_causes(weighing: RunWeighing) -> str:
    """Return the likeliest causes with their probabilities."""
    return "known: " + ", ".join(f"{plain_name(n)} {p:.2f}" for n, p in by_probability(weighing, 0.01))


def by_probability(weighing: RunWeighing, least: float) -> list[tuple[str, float]]:
    """Return the causes of at least a probability, the likeliest first."""
    order = sorted(weighing.probability.items(), key=lambda item: -item[1])
    return [(n, p) for n, p in order if p >= least]


def size(weighing: RunWeighing, name: str) -> str:
    """Return a cause's main parameter with its 95 % interval, as a diagnosis states it; empty for no cause.

    The simulation's own doubt is included.
    """
    if name == NOTHING:
        return ""
    main = effect_named(name).main
    hypothesis = next(h for h in weighing.hypotheses() if h.name == name)
    k = [u.name for u in hypothesis.problem.unknowns].index(f"{name}.{main.name}")
    unknown, at = hypothesis.problem.unknowns[k], float(hypothesis.theta[k])
    sd = float(hypothesis.sd()[k])
    value = unknown.outer(at)
    noise = abs(unknown.outer(at + sd) - unknown.outer(at - sd)) / 2.0
    clock = CLOCK_DOUBT if main.unit == "s" else 0.0
    half = Z95 * math.hypot(noise, DEFAULT.sizes.model_error * value, clock)
    text = words.measured_text(value, value - half, value + half, main.unit)
    return f"{main.name.replace('_', ' ')} {text}"


_ENDS = {
    "confirmed": "{cause}, {size}: probability {sure} {spent}",
    "nothing_wrong": "No cause: the rig with fitted values explains everything, probability {sure} {spent}",
    "unexplained": "None of the causes explains the runs {spent}: the best, {cause}, leaves {left:.2f} times "
    "the noise",
    "undecidable": "No further run would help: {remain} {spent}",
    "spent": "The budget is spent {spent}: {remain}",
    "declined": "The next run was declined {spent}: {remain}",
    "broken": "A run was aborted ({why}) and is not used; {remain}",
}


def end_sentence(outcome: CampaignOutcome) -> str:
    """Return how a session ended."""
    cause, weighing = outcome.cause, outcome.weighing
    spent = f"after {outcome.seconds:.3g} s of excitation in {' '.join(run_count(outcome))}"
    if outcome.end == "undecidable" and outcome.shared is not None:
        return shared_words(outcome, f" {spent}")
    likely = [f"{plain_name(n)} ({p:.2f})" for n, p in by_probability(weighing, 0.05)]
    return _ENDS.get(outcome.end, "The session could not continue ({why}): {remain}").format(
        cause=plain_name(cause), size=size(weighing, cause), spent=spent, why=outcome.why, left=weighing.left,
        sure=words.probability(weighing.probability[cause]), remain=f"{list_names(likely)} remain possible",
    )  # fmt: skip


def shared_words(outcome: CampaignOutcome, spent: str = "") -> str:
    """Return which causes share the name, and what would tell them apart. spent: after what, in words."""
    assert outcome.shared is not None
    names, torque = outcome.shared.names, outcome.shared.torque
    of = outcome.weighing.probability
    head = " or ".join(f"{plain_name(n)} ({of[n]:.2f})" for n in names)
    needed = "" if torque is None else f"; it takes at least about {torque:.2g} N·m"
    return f"{head}: no run within the limits shows which{spent}{needed}"


def run_count(outcome: CampaignOutcome) -> tuple[str, str]:
    """Return how many runs were played, and their noun: ("1", "run")."""
    count = sum(r.proposal is not None for r in outcome.rounds)
    return str(count), "run" if count == 1 else "runs"


def advice_json(advice: Advice) -> dict[str, Any]:
    """Return the contents of experiment.json. Infinite numbers are null."""
    return {
        "schema": 1, "sentence": verdict(advice),
        "causes": {h.name: strict(h.probability) for h in advice.hypotheses},
        "excluded": strict(advice.excluded), "limits": strict(advice.asked.limits.finite_limits()),
        "limits_hold_with_probability": LEVEL, "run": _run(advice.proposal),
        "no_run_separates": [_proof(x) for x in advice.proofs],
    }  # fmt: skip


def campaign_json(outcome: CampaignOutcome, campaign: Campaign) -> dict[str, Any]:
    """Return the contents of experiment.json of a session."""
    shared = outcome.shared
    return {
        "schema": 1,
        "end": outcome.end,
        "sentence": end_sentence(outcome),
        **pick(outcome, "cause why"),
        "one_of": [] if shared is None else list(shared.names),
        "torque_needed": None if shared is None else strict(shared.torque),
        **pick(outcome, "seconds"),
        **pick(campaign, "causes"),
        "limits": strict(campaign.asked.limits.finite_limits()),
        "rounds": [
            {**pick(r.weighing, "probability times_noise_left=left"), "run": _run(r.proposal)}
            for r in outcome.rounds
        ],
        "no_run_separates": [_proof(x) for x in outcome.proofs],
    }


def _run(p: Proposal | None) -> dict[str, Any] | None:
    if p is None:
        return None
    pairs = [
        {"true": a, "rival": b, "separation": strict(float(p.table[i, j]))}
        for i, a in enumerate(p.names) for j, b in enumerate(p.names) if i != j
    ]  # fmt: skip
    peaks = pick(p, "peaks_expected=peaks.expected peaks_at_level=peaks.at_level narrowed_nats=sharpened")
    shape = pick(p, "shape duration_s=duration rate_hz=rate decided")
    return {**shape, "separations": pairs, **peaks, **pick(p, "shapes_judged=tried")}


def _proof(proof: Proof) -> dict[str, Any]:
    b = proof.bound
    return {
        "causes": [b.true, b.rival],
        **pick(b, "at_most=most duration_s=duration"),
        "band_hz": strict(b.frequency[[0, -1]]),
        "measure_apart": [pick(a, "what separation") for a in proof.apart],
        "sentence": proof_words(proof),
    }
