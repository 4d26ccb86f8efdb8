"""The pages of a designed run and of a session of runs: causes, separations, demands, commands."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from rsea_ros.experiment.advice import Advice, Proof
from rsea_ros.experiment.campaign import Campaign, CampaignOutcome
from rsea_ros.experiment.proposal import Proposal
from rsea_ros.experiment.run_shape import RunLimits, run_text
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.new_files import NewFiles, check_free
from rsea_ros.records.record import FloatArray
from rsea_ros.report import words
from rsea_ros.report.experiment import words as say
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.page import Block, Html, bullets, key_numbers, page, section, table
from rsea_ros.report.result_files import EXPERIMENT_JSON, MODEL, REPORT, Provenance, json_text

_COLOURS = (fig.AFTER, fig.BEFORE, fig.TRUTH, "#862e9c", "#5c940d", "#0b7285")
_DASH = ("solid", "dash", "dot", "dashdot")
_SHOWN, _ROWS = 0.02, 8
"""Causes of a session that the page shows: the probability at least, and how many in a row of the table."""


def check_session_free(out: Path) -> None:
    """Refuse, before any run, a folder that holds files of a session: no run is played and then lost.

    Raises OutputError for the first of them.
    """
    check_free([*(out / name for name in (EXPERIMENT_JSON, MODEL, REPORT)), *sorted(out.glob("run-*"))])


def write_campaign(
    outcome: CampaignOutcome, campaign: Campaign, out: Path, notes: tuple[str, ...] = (),
    provenance: Provenance | None = None,
) -> Path:  # fmt: skip
    """Write experiment.json, model.yaml, report.html and the commands; return the report's path.

    model.yaml: the rig with the likeliest cause and the values of all records together.
    """
    with NewFiles(out) as new:
        for k, p in _played(outcome):
            new.write(f"run-{k}.csv", run_text(p.command, p.rate))
        new.write(EXPERIMENT_JSON, json_text(say.campaign_json(outcome, campaign), provenance))
        new.write(MODEL, rig_text(outcome.weighing.hypotheses()[0].rig))
        text = campaign_page(outcome, campaign.rig.name, campaign.asked.limits, notes, provenance)
        return new.write(REPORT, text)


def _played(outcome: CampaignOutcome) -> list[tuple[int, Proposal]]:
    return [(k, r.proposal) for k, r in enumerate(outcome.rounds, 1) if r.proposal is not None]


def advice_page(advice: Advice, provenance: Provenance | None = None) -> str:
    """Return the page of an offline design."""
    kicker = f"The next experiment · {advice.hypotheses[0].problem.rig.name}"
    return page(say.verdict(advice), kicker, _advice(advice), (), provenance)


def _advice(advice: Advice) -> Iterator[Block]:
    p = advice.proposal
    if p is not None:
        keys = [
            (f"{p.duration:.3g} s", "of excitation"),
            (f"{p.peaks.at_level['torque']:.3g} N·m", "largest torque"),
        ]
        if p.worst is not None:
            true, rival, s = p.worst
            keys.append(
                (f"{s:.3g}", f"S of {say.plain_name(true)} over {say.plain_name(rival)}, the worst pair")
            )
        yield key_numbers(
            keys if len(p.names) == 1 else [*keys, (say.decided_words(p), "expected to be decided")]
        )
    rows = [(say.plain_name(h.name), f"{h.probability:.3f}") for h in advice.hypotheses]
    rows += [
        (f"{say.plain_name(n)} (excluded by the records)", f"{p:.1g}") for n, p in advice.excluded.items()
    ]
    yield section("Still possible", table(("cause", "#probability"), rows))
    if p is not None:
        yield from [_separations(p)] if len(p.names) > 1 else []
        yield command_figure(p)
        yield spectrum_figure([("run", p)])
        yield _demands(p, advice.asked.limits)
    yield from _proofs(advice.proofs)


def _separations(p: Proposal) -> Html:
    def number(value: float) -> str:
        return f"{value:.2g}" if value < 1e4 else f"{value:.0e}"

    rows = [
        (say.plain_name(a), *("" if a == b else number(p.table[i, j]) for j, b in enumerate(p.names)))
        for i, a in enumerate(p.names)
    ]
    caption = (
        "S, row true, column its rival: twice the expected gain of the logarithm of the odds after the rival "
        "has been fitted to the run. 6 makes odds of twenty to one."
    )
    head = ("true \\ rival", *(f"#{say.plain_name(n)}" for n in p.names))
    return section("Causes that the run separates", table(head, rows), caption=caption)


def _demands(p: Proposal, limits: RunLimits) -> Html:
    rows = table(
        ("quantity", "#expected", "#at level", "#limit", "unit"), say.limit_rows(p, limits.finite_limits())
    )
    return section("Demands on the bench", rows, caption=f"At level: {say.LEVEL_WORDS}.")


def _proofs(proofs: Sequence[Proof]) -> list[Html]:
    return [section("Not separable by any run", bullets(map(say.proof_words, proofs)))] if proofs else []


def command_figure(p: Proposal) -> fig.Figure:
    """Return the command over time."""
    t, caption = (
        np.arange(len(p.command)) / p.rate,
        "Commanded motor torque at the gear output; it begins and ends",
    )
    drawn = fig.line(t, p.command, "command", fig.AFTER, 1.0, hovertemplate="%{y:.3g} N·m")
    plane = fig.layout(xaxis=fig.axis("time, s"), yaxis=fig.axis("torque, N·m"))
    return fig.Figure(
        f"The run: {say.shape_words(p)}", f"{caption} at zero under a raised cosine.", [drawn], plane, 300
    )


def spectrum_figure(runs: Sequence[tuple[str, Proposal]]) -> fig.Figure:
    """Return the amplitude spectral densities of runs."""
    traces, names = [], []
    for k, (name, p) in enumerate(runs):
        f, density = density_of(p.command, p.rate)
        colour = (fig.AFTER, fig.BEFORE, fig.QUIET)[k % 3]
        look: fig.Json = {"line": {"color": colour, "width": 1.4, "dash": _DASH[k % 4]}}
        traces.append(fig.line(f, density, name, colour, hovertemplate="%{y:.3g} N·m/√Hz", **look))
        names.append((name, colour))
    top = float(np.log10(max(y for trace in traces for y in trace["y"])))
    height = fig.axis("N·m/√Hz", type="log", range=[top - 3.0, top + 0.3])
    title = "Where the runs put their power" if len(runs) > 1 else "Where the run puts its power"
    drawing = fig.layout(
        xaxis=fig.frequency_axis(0.2, 140.0), yaxis=height, annotations=fig.names_beside(names, 0.075)
    )
    return fig.Figure(title, "Amplitude spectral density of the command.", traces, drawing, height=320)


def density_of(command: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return frequency (Hz) and amplitude spectral density (N m/sqrt(Hz)) of a command, smoothed."""
    n = len(command)
    power = np.abs(np.fft.rfft(command)) ** 2 * 2.0 / (rate * n)
    frequency = np.fft.rfftfreq(n, 1.0 / rate)
    edges = np.unique(np.concatenate([np.arange(1, 8), np.geomspace(8, len(power) - 1, 60).astype(int)]))

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(values[: edges[-1]], edges[:-1]) / np.diff(edges), float)

    return mean(np.asarray(frequency, float)), np.sqrt(mean(np.asarray(power, float)))


def campaign_page(
    outcome: CampaignOutcome, rig: str, limits: RunLimits, notes: tuple[str, ...] = (),
    provenance: Provenance | None = None,
) -> str:  # fmt: skip
    """Return the page of a session: the remaining causes after each run. notes: on its making."""
    title, kicker = words.sentence(say.end_sentence(outcome)), f"A session of experiments · {rig}"
    return page(title, kicker, _session(outcome, limits, notes), (), provenance)


def _session(outcome: CampaignOutcome, limits: RunLimits, notes: Sequence[str]) -> Iterator[Block]:
    weighing, played = outcome.weighing, _played(outcome)
    yield key_numbers([
        (f"{weighing.probability[outcome.cause]:.1%}", say.plain_name(outcome.cause)),
        (f"{outcome.seconds:.3g} s", "of excitation"),
        say.run_count(outcome),
        (f"{weighing.left:.2f}", "times the noise remains"),
    ])  # fmt: skip
    yield probability_figure(outcome)
    yield _rounds(outcome)
    if played:
        yield spectrum_figure([(f"run {k}", p) for k, p in played])
        yield from (command_figure(p) for _, p in played)
        yield _demands(played[-1][1], limits)
    yield from _proofs(outcome.proofs)
    if notes:
        yield section("Method", bullets(notes))


def probability_figure(outcome: CampaignOutcome) -> fig.Figure:
    """Return the probability of each cause before the first run and after each."""
    rounds = [r.weighing.probability for r in outcome.rounds]
    x = np.arange(len(rounds), dtype=float)
    names = sorted({n for r in rounds for n, p in r.items() if p >= _SHOWN})
    names.sort(key=lambda n: -rounds[-1].get(n, 0.0))
    traces, shown = [], []
    for k, name in enumerate(names):
        colour = _COLOURS[k] if k < len(_COLOURS) else fig.QUIET
        y, dot = np.array([r.get(name, 0.0) for r in rounds]), {"size": 7, "color": colour}
        hover = {"mode": "lines+markers", "marker": dot, "hovertemplate": "probability %{y:.3f}"}
        traces.append(fig.line(x, y, say.plain_name(name), colour, 2.2, **hover))
        shown.append((say.plain_name(name), colour))
    ticks = ["first records" if not k else f"after run {k}" for k in range(len(rounds))]
    drawing = fig.layout(
        xaxis=fig.axis(tickvals=fig.numbers(x), ticktext=ticks, range=[-0.2, float(x[-1]) + 0.2]),
        yaxis=fig.axis("probability", range=[-0.03, 1.06]),
        annotations=fig.names_beside(shown, 0.075),
        margin={"l": 64, "r": 180, "t": 12, "b": 48},
    )
    caption = (
        "Probability of each cause by all records up to there. Each cause weighed here is as likely as any "
        "other before the first record."
    )
    return fig.Figure("Remaining causes after each run", caption, traces, drawing, height=360)


def _rounds(outcome: CampaignOutcome) -> Html:
    rows = []
    for k, r in enumerate(outcome.rounds):
        order = say.by_probability(r.weighing, 0.0)
        possible = ", ".join(f"{say.plain_name(n)} {p:.2f}" for n, p in order[:_ROWS] if p >= _SHOWN)
        run = f"{say.shape_words(r.proposal)}; {r.proposal.resolved:.0%} expected" if r.proposal else ""
        rows.append((f"run {k}" if k else "first records", possible, say.size(r.weighing, order[0][0]), run))
    return section("Run by run", table(("after", "possible", "size of the likeliest", "next run"), rows))
