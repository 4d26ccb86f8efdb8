"""The page of a session of experiments: the remaining causes after each run, and its command."""

from __future__ import annotations

import numpy as np

from rsea_ros.experiment.campaign import CampaignOutcome
from rsea_ros.experiment.run_shape import RunLimits
from rsea_ros.report.campaign.words import end_sentence, run_count, size
from rsea_ros.report.experiment.page import command_figure, limits_section, spectrum_figure
from rsea_ros.report.experiment.words import plain_name, proof_words, shape_words
from rsea_ros.report.figures.figure import Figure, axis, label, layout, line, numbers
from rsea_ros.report.figures.palette import AFTER, BEFORE, QUIET, TRUTH
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import bullets, key_numbers, section
from rsea_ros.report.page.html_table import table
from rsea_ros.report.provenance import Provenance

_COLOURS = (AFTER, BEFORE, TRUTH, "#862e9c", "#5c940d", "#0b7285")
_SHOWN = 0.02
_ROWS = 8


def campaign_page(
    outcome: CampaignOutcome,
    rig: str,
    limits: RunLimits,
    notes: tuple[str, ...] = (),
    provenance: Provenance | None = None,
) -> str:
    """Return the page. notes: remarks on its making for the reader."""
    played = [(k, r.proposal) for k, r in enumerate(outcome.rounds, 1) if r.proposal is not None]
    blocks: list[Block] = [key_numbers(_keys(outcome)), probability_figure(outcome), _table(outcome)]
    if played:
        blocks.append(spectrum_figure([(f"run {k}", p) for k, p in played]))
        blocks += [command_figure(p) for _, p in played]
        blocks.append(limits_section(played[-1][1], limits.finite_limits()))
    if outcome.proofs:
        blocks.append(section("Not separable by any run", bullets([proof_words(x) for x in outcome.proofs])))
    if notes:
        blocks.append(section("Method", bullets(notes)))
    footer = provenance.lines if provenance else ()
    return page(_title(outcome), f"A session of experiments · {rig}", blocks, footer)


def _title(outcome: CampaignOutcome) -> str:
    text = end_sentence(outcome)
    return text[0].upper() + text[1:]


def _keys(outcome: CampaignOutcome) -> list[tuple[str, str]]:
    p = outcome.weighing.probability[outcome.cause]
    keys = [(f"{p:.1%}", plain_name(outcome.cause)), (f"{outcome.seconds:.3g} s", "of excitation")]
    return [*keys, run_count(outcome), (f"{outcome.weighing.left:.2f}", "times the noise remains")]


def probability_figure(outcome: CampaignOutcome) -> Figure:
    """Return the probability of each cause before the first run and after each."""
    rounds = outcome.rounds
    x = np.arange(len(rounds), dtype=float)
    names = sorted({n for r in rounds for n, p in r.weighing.probability.items() if p >= _SHOWN})
    names.sort(key=lambda n: -rounds[-1].weighing.probability.get(n, 0.0))
    traces, notes = [], []
    for k, name in enumerate(names):
        colour = _COLOURS[k] if k < len(_COLOURS) else QUIET
        y = np.array([r.weighing.probability.get(name, 0.0) for r in rounds])
        traces.append(
            line(
                x, y, plain_name(name), colour, 2.2, mode="lines+markers",
                marker={"size": 7, "color": colour}, hovertemplate="probability %{y:.3f}",
            )
        )
        if y[-1] >= 0.03 or k == 0:
            notes.append(label(plain_name(name), 1.01, float(y[-1]), colour, xref="paper"))
    ticks = ["first records" if not k else f"after run {k}" for k in range(len(rounds))]
    return Figure(
        "Remaining causes after each run",
        "Probability of each cause by all records up to there. Each cause weighed here is as likely as "
        "any other before the first record.",
        traces,
        layout(
            xaxis=axis(tickvals=numbers(x), ticktext=ticks, range=[-0.2, float(x[-1]) + 0.2]),
            yaxis=axis("probability", range=[-0.03, 1.06]),
            annotations=notes,
            margin={"l": 64, "r": 180, "t": 12, "b": 48},
        ),
        height=360,
    )


def _table(outcome: CampaignOutcome) -> str:
    rows = []
    for k, r in enumerate(outcome.rounds):
        order = sorted(r.weighing.probability.items(), key=lambda item: -item[1])
        possible = ", ".join(f"{plain_name(n)} {p:.2f}" for n, p in order[:_ROWS] if p >= _SHOWN)
        run = "" if r.proposal is None else f"{shape_words(r.proposal)}; {r.proposal.resolved:.0%} expected"
        rows.append(("first records" if not k else f"run {k}", possible, size(r.weighing, order[0][0]), run))
    return section("Run by run", table(("after", "possible", "size of the likeliest", "next run"), rows))
