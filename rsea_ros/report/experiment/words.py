"""A designed run in sentences."""

from __future__ import annotations

import math

from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import list_names
from rsea_ros.experiment.advice import Advice, Proof
from rsea_ros.experiment.hypothesis import NOTHING, Hypothesis
from rsea_ros.experiment.proposal import LEVEL, Proposal
from rsea_ros.experiment.run_shape import UNITS
from rsea_ros.report import words

_NARROWER = 1.01
"""Factor below which a run does not narrow an interval."""


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
        f"{low:.2g} to {high:.3g} Hz within the limits separates them by more than S = {b.most:.2g} "
        "(6 makes odds of twenty to one)"
    )
    return f"{head}. Measure separately: {'; or '.join(a.what for a in proof.apart)}."


def limit_rows(p: Proposal, stated: dict[str, float]) -> list[tuple[str, str, str, str, str]]:
    """Return each quantity: expected, at the level that is stated, limit, unit."""
    names = [n for n in UNITS if n in p.peaks.expected]
    return [
        (
            n,
            f"{p.peaks.expected[n]:.4g}",
            f"{p.peaks.at_level[n]:.4g}",
            f"{stated[n]:.4g}" if n in stated else "none",
            plain(UNITS[n]),
        )
        for n in names
    ]


LEVEL_WORDS = (
    f"the upper limit at a probability of {LEVEL:.5f}, over the causes still possible and what is known of "
    "their numbers, to first order"
)
