"""Designed runs and sessions of them in sentences, and experiment.json."""

import math
from typing import Any

from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import list_names
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.experiment.advice import Advice, Proof
from rsea_ros.experiment.campaign import Campaign, CampaignOutcome
from rsea_ros.experiment.hypothesis import NOTHING, Hypothesis
from rsea_ros.experiment.joint_weighing import RunWeighing
from rsea_ros.experiment.proposal import LEVEL, Proposal
from rsea_ros.experiment.run_shape import UNITS
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.result_files import pick, strict

SCHEMA = 1

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
    between, share = list_names(names), decided_words(p)
    return f"The next run is expected to decide between {between} in {share} of cases: {shape_words(p)}"


def decided_words(p: Proposal) -> str:
    """Return the share of the cases that a run is expected to decide."""
    return f"{100.0 * p.decided:.0f} %"


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
    return [
        (
            n, f"{expected:.4g}", f"{p.peaks.at_level[n]:.4g}", f"{stated[n]:.4g}" if n in stated else "none",
            plain(unit),
        )
        for n, unit, expected in (
            (n, u, p.peaks.expected[n]) for n, u in UNITS.items() if n in p.peaks.expected
        )
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


def end_sentence(outcome: CampaignOutcome) -> str:
    """Return how a session ended."""
    cause, p = outcome.cause, outcome.weighing.probability[outcome.cause]
    spent = f"after {outcome.seconds:.3g} s of excitation in {' '.join(run_count(outcome))}"
    likely = [f"{plain_name(n)} ({p:.2f})" for n, p in by_probability(outcome.weighing, 0.05)]
    remain = f"{list_names(likely)} remain possible"
    match outcome.end:
        case "confirmed":
            return f"{plain_name(cause)}, {size(outcome.weighing, cause)}: probability {p:.3f} {spent}"
        case "nothing_wrong":
            return f"No cause: the rig with fitted values explains everything, probability {p:.3f} {spent}"
        case "unexplained":
            return (
                f"None of the causes explains the runs {spent}: the best, {plain_name(cause)}, leaves "
                f"{outcome.weighing.left:.2f} times the noise"
            )
        case "undecidable" if outcome.shared is not None:
            return shared_words(outcome, f" {spent}")
        case "undecidable":
            return f"No further run would help: {remain} {spent}"
        case "spent":
            return f"The budget is spent {spent}: {remain}"
        case "declined":
            return f"The next run was declined {spent}: {remain}"
        case "broken":
            return f"A run was aborted ({outcome.why}) and is not used; {remain}"
        case _:
            return f"The session could not continue ({outcome.why}): {remain}"


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
        "schema": SCHEMA, "sentence": verdict(advice),
        "causes": {h.name: strict(h.probability) for h in advice.hypotheses},
        "excluded": strict(advice.excluded), "limits": strict(advice.asked.limits.finite_limits()),
        "limits_hold_with_probability": LEVEL, "run": _run(advice.proposal),
        "no_run_separates": [_proof(x) for x in advice.proofs],
    }  # fmt: skip


def campaign_json(outcome: CampaignOutcome, campaign: Campaign) -> dict[str, Any]:
    """Return the contents of experiment.json of a session."""
    shared = outcome.shared
    return {
        "schema": SCHEMA,
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
