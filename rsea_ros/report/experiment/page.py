"""The page of a designed run: the causes that it separates, its demands on the bench, its command."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.experiment.advice import Advice
from rsea_ros.experiment.proposal import Proposal
from rsea_ros.records.record import FloatArray
from rsea_ros.report.experiment.words import (
    LEVEL_WORDS,
    decided_words,
    limit_rows,
    plain_name,
    proof_words,
    shape_words,
    verdict,
)
from rsea_ros.report.figures.figure import Figure, axis, frequency_axis, label, layout, line
from rsea_ros.report.figures.palette import AFTER, BEFORE, QUIET
from rsea_ros.report.page.frame import Block, page
from rsea_ros.report.page.html import bullets, key_numbers, section
from rsea_ros.report.page.html_table import table
from rsea_ros.report.provenance import Provenance


def advice_page(advice: Advice, provenance: Provenance | None = None) -> str:
    """Return the page of an offline design."""
    blocks: list[Block] = [_causes(advice)]
    p = advice.proposal
    if p is not None:
        blocks = [
            key_numbers(_keys(p)),
            *blocks,
            *([_separations(p)] if len(p.names) > 1 else []),
            command_figure(p),
            spectrum_figure([("run", p)]),
        ]
        blocks += [limits_section(p, advice.asked.limits.finite_limits())]
    if advice.proofs:
        blocks.append(section("Not separable by any run", bullets([proof_words(x) for x in advice.proofs])))
    rig = advice.hypotheses[0].problem.rig.name
    return page(
        verdict(advice), f"The next experiment · {rig}", blocks, provenance.lines if provenance else ()
    )


def _keys(p: Proposal) -> list[tuple[str, str]]:
    worst = p.worst
    keys = [
        (f"{p.duration:.3g} s", "of excitation"),
        (f"{p.peaks.at_level['torque']:.3g} N·m", "largest torque"),
    ]
    if worst is not None:
        keys.append(
            (f"{worst[2]:.3g}", f"S of {plain_name(worst[0])} over {plain_name(worst[1])}, the worst pair")
        )
    return keys if len(p.names) == 1 else [*keys, (decided_words(p), "expected to be decided")]


def _causes(advice: Advice) -> str:
    rows = [(plain_name(h.name), f"{h.probability:.3f}") for h in advice.hypotheses]
    rows += [(f"{plain_name(n)} (excluded by the records)", f"{p:.1g}") for n, p in advice.excluded.items()]
    return section("Still possible", table(("cause", "probability"), rows, {1}))


def _separations(p: Proposal) -> str:
    rows = [
        (plain_name(a), *("" if a == b else _number(p.table[i, j]) for j, b in enumerate(p.names)))
        for i, a in enumerate(p.names)
    ]
    caption = (
        "S, row true, column its rival: twice the expected gain of the logarithm of the odds after the rival "
        "has been fitted to the run. 6 makes odds of twenty to one."
    )
    head = ("true \\ rival", *(plain_name(n) for n in p.names))
    return section("Causes that the run separates", table(head, rows, range(1, len(head))), caption=caption)


def _number(value: float) -> str:
    return f"{value:.2g}" if value < 1e4 else f"{value:.0e}"


def limits_section(p: Proposal, stated: dict[str, float]) -> str:
    """Return the peaks of a run beside the limits of the bench."""
    head = ("quantity", "expected", "at level", "limit", "unit")
    return section(
        "Demands on the bench",
        table(head, limit_rows(p, stated), {1, 2, 3}),
        caption=f"At level: {LEVEL_WORDS}.",
    )


def command_figure(p: Proposal) -> Figure:
    """Return the command over time."""
    t = np.arange(len(p.command)) / p.rate
    return Figure(
        f"The run: {shape_words(p)}",
        "Commanded motor torque at the gear output; it begins and ends at zero under a raised cosine.",
        [line(t, p.command, "command", AFTER, 1.0, hovertemplate="%{y:.3g} N·m")],
        layout(xaxis=axis("time, s"), yaxis=axis("torque, N·m")),
        height=300,
    )


def spectrum_figure(runs: Sequence[tuple[str, Proposal]]) -> Figure:
    """Return the amplitude spectral densities of runs."""
    traces, notes = [], []
    tops = []
    for k, (name, p) in enumerate(runs):
        f, density = density_of(p.command, p.rate)
        colour = (AFTER, BEFORE, QUIET)[k % 3]
        traces.append(
            line(
                f, density, name, colour, line={"color": colour, "width": 1.4, "dash": _DASH[k % 4]},
                hovertemplate="%{y:.3g} N·m/√Hz",
            )
        )
        at = int(np.argmax(density))
        notes.append(label(name, float(np.log10(f[at])), float(np.log10(density[at])) + 0.12, colour))
        tops.append(density.max())
    top = float(np.log10(max(tops)))
    return Figure(
        "Where the runs put their power" if len(runs) > 1 else "Where the run puts its power",
        "Amplitude spectral density of the command.",
        traces,
        layout(
            xaxis=frequency_axis(0.2, 140.0),
            yaxis=axis("N·m/√Hz", type="log", range=[top - 3.0, top + 0.3]),
            annotations=notes,
        ),
        height=320,
    )


_DASH = ("solid", "dash", "dot", "dashdot")


def density_of(command: FloatArray, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return frequency (Hz) and amplitude spectral density (N m/sqrt(Hz)) of a command, smoothed."""
    n = len(command)
    power = np.abs(np.fft.rfft(command)) ** 2 * 2.0 / (rate * n)
    frequency = np.fft.rfftfreq(n, 1.0 / rate)
    edges = np.unique(np.concatenate([np.arange(1, 8), np.geomspace(8, len(power) - 1, 60).astype(int)]))
    starts = edges[:-1]
    counts = np.diff(edges)
    smooth = np.add.reduceat(power, starts)[: len(counts)]
    smooth[-1] = power[starts[-1] : edges[-1]].sum()
    middle = np.add.reduceat(frequency, starts)[: len(counts)]
    middle[-1] = frequency[starts[-1] : edges[-1]].sum()
    return middle / counts, np.sqrt(smooth / counts)
