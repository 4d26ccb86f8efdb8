"""Effects hidden on a plant that shares no code with the project (test/independent), one or several at once.

    python -m bench diagnosis coverage play --log L [--severity medium] [--sample 60]     resumes
    python -m bench diagnosis coverage table --log L
    python -m bench diagnosis overlap play --log L [--records 10] [--hidden 4]            resumes
    python -m bench diagnosis overlap score --log L

coverage: one effect, one kind of work, one severity. A cell counts where its effect shows: where the rig
alone, fitted, leaves more than the noise in some channel. Found: the effect is named, alone or among the
rivals of a cause. Where it alone is named, z = (estimate - truth) / sigma of its parameters and of the rig's
values says whether the intervals after a diagnosis are honest.

overlap: each effect is mild to medium, of another mechanism than the others: two frictions in one gear would
be one law. Named: with any status, or as a rival of a named cause. False: a cause with status `confirmed`
that is not hidden. One that hides below the noise counts as missed.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
from independent.bench import Bench, drawn_bench, record_command
from independent.severities import SEVERITIES, SIZES, drawn_parameters

from bench.diagnosis.cases import RIG, RIG_VALUES, hide_all
from bench.diagnosis.commands import COMMANDS
from bench.diagnosis.played import DOUBTED, Entry, Line, Played, is_error, names_of, play_all, verdict_on
from bench.results import Row, read_lines
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.statistics import Z95

SHOWS = 1.1
"""Residual of the fitted rig over the noise from which an effect shows."""
MARKS = {"named": "+", "rival": "r", "other": "x", "none": "-", "hidden": ".", "error": "E"}
MECHANISMS = (
    ("coulomb_friction", "asymmetric_friction", "load_dependent_friction"),
    ("nonlinear_spring", "spring_hysteresis", "stiffness_drift"),
    ("command_delay", "current_loop_lag", "torque_constant_error"),
    ("ft_drift", "mains_interference", "structural_resonance"),
    ("torque_ripple", "damping_drift"),
)
FURTHER = (("backlash",), ("torque_saturation",))
"""Mechanisms of which records draw too that hide more than five effects."""


def coverage(
    step: Annotated[str, ("play", "table")], *, log: Path,
    severity: Annotated[tuple[str, ...], SEVERITIES] = SEVERITIES,
    work: Annotated[tuple[str, ...], COMMANDS] = tuple(COMMANDS),
    effect: Annotated[tuple[str, ...], SIZES] = tuple(SIZES),
    sample: int = 0, seed: int = 5, duration: float = 20.0,
) -> Iterator[Row | str]:  # fmt: skip
    """Play which effects are found, by kind of work and by severity, or print the outcomes by cell.

    log: JSON lines, a cell each
    sample: at most so many cells, drawn by the seed
    seed: of records
    duration: of records, s
    """
    if step == "table":
        yield from _cells(read_lines(log))
        return
    cells = list(product(effect, work, severity))
    order = np.random.default_rng(seed).permutation(len(cells))[: sample or None]
    named = {f"{'/'.join(cells[k])}/{seed}/{duration:g}": cells[k] for k in order}
    entries = [Entry(name, partial(_one_hidden, *cell, seed, duration)) for name, cell in named.items()]
    yield from play_all(entries, log)


def overlap(
    step: Annotated[str, ("play", "score")], *, log: Path, records: int = 10, hidden: int = 4,
    max_causes: int = 6,
) -> Iterator[Row | str]:  # fmt: skip
    """Play several small effects at once, or score what is named, missed, and false.

    log: JSON lines, a record each
    records: seeds from 0 on
    hidden: effects in a record
    max_causes: of the search
    """
    if step == "score":
        yield from _shares(read_lines(log))
        return
    entries = [Entry(str(k), partial(_several_hidden, k, hidden)) for k in range(records)]
    yield from play_all(entries, log, DiagnosisSettings(max_causes))


def _one_hidden(effect: str, work: str, severity: str, seed: int, duration: float) -> Played:
    """Return a record (duration in s) of a hidden effect with its truth."""
    rng = np.random.default_rng([seed, *map(ord, effect + work + severity)])
    parameters = drawn_parameters(effect, severity, rng)
    return _recorded(drawn_bench(rng), {effect: parameters}, work, duration, rng)


def _several_hidden(seed: int, number: int) -> Played:
    """Return a record of 25 s with a number of effects hidden in it."""
    rng = np.random.default_rng([12, seed])
    mechanisms = MECHANISMS if number <= len(MECHANISMS) else (*MECHANISMS, *FURTHER)
    groups = rng.permutation(len(mechanisms))[:number]
    names = [str(rng.choice(mechanisms[k])) for k in sorted(groups)]
    hidden = {n: drawn_parameters(n, str(rng.choice(("mild", "medium"))), rng) for n in names}
    return _recorded(drawn_bench(rng), hidden, ("chirp", "multisine", "work")[seed % 3], 25.0, rng)


def _recorded(
    drawn: Bench, hidden: Mapping[str, Mapping[str, float]], work: str, duration: float,
    rng: np.random.Generator,
) -> Played:  # fmt: skip
    bench = hide_all(drawn, hidden)
    record = record_command(bench, COMMANDS[work](bench, duration, rng), rng)
    values = {name: getattr(drawn.plant, n) for name, n in RIG_VALUES.items()}
    return Played(record, load_rig(RIG), (), tuple(hidden), hidden, values, about={"work": work})


def _judged(line: Line) -> str:
    """Return the outcome of a cell, a key of MARKS."""
    (effect,) = line["truth"]
    if is_error(line):
        return "error"
    if effect in names_of(line):
        return "named"
    if any(effect in c["rivals"] for c in line["causes"]):
        return "rival"
    return "other" if line["causes"] else "hidden" if line["left"] <= SHOWS else "none"


def _cells(lines: Sequence[Line]) -> Iterator[Row | str]:
    by_cell: dict[tuple[str, str, str], str] = {}
    for line in lines:
        effect, work, severity, *_ = line["record"].split("/")
        by_cell[effect, work, severity] = by_cell.get((effect, work, severity), "") + MARKS[_judged(line)]
    for effect in SIZES:
        cells = {w: " ".join(by_cell.get((effect, w, s), " ") for s in SEVERITIES) for w in COMMANDS}
        yield Row(effect, "", cells)
    outcomes = [_judged(line) for line in lines]
    showing = len(lines) - outcomes.count("hidden")
    found = outcomes.count("named") + outcomes.count("rival")
    wrong = sum(bool(verdict_on(line).surely_wrong) for line in lines)
    yield f"\nmild, medium, strong; {', '.join(f'{m} {o}' for o, m in MARKS.items())}"
    yield (f"found {found} of {showing} that show ({len(lines)} played): {found / max(showing, 1):.1%}; "
           f"wrong and confirmed: {wrong}")  # fmt: skip
    yield from _z_scores([line["z"] for line in lines if line.get("z")])


def _z_scores(scored: Sequence[Mapping[str, float]]) -> Iterator[Row]:
    """Yield the RMS of z of each value of the rig, of the causes' parameters, and of all."""
    groups: dict[str, list[float]] = {}
    for name, z in (item for scores in scored for item in scores.items()):
        of_cause = "causes" + DOUBTED * name.endswith(DOUBTED)
        groups.setdefault(name if name in RIG_VALUES else of_cause, []).append(z)
    groups["all of the noise alone"] = [z for s in scored for n, z in s.items() if not n.endswith(DOUBTED)]
    for name, group in groups.items():
        size = np.abs(group)
        yield Row(name, "", {
            "values": str(len(group)), "RMS": f"{np.sqrt(np.mean(size**2)):.2f}",
            "median of abs(z) / 0.674": f"{np.median(size) / 0.6745:.2f}",
            "abs(z) < 1.96, %": f"{100.0 * np.mean(size < Z95):.0f}",
        })  # fmt: skip


def _shares(lines: Sequence[Line]) -> Iterator[Row | str]:
    """Yield a row for each record, hidden effects with their status and what else was said; then shares."""
    found = every = causes = 0
    for line in lines:
        told = {c["name"]: c["status"] for c in line["causes"]}
        told = dict.fromkeys((n for c in line["causes"] for n in c["rivals"]), "rival") | told
        found += sum(n in told for n in line["truth"])
        every, causes = every + len(line["truth"]), causes + len(line["causes"])
        hidden = ", ".join(f"{n}: {told.get(n, 'missed')}" for n in line["truth"])
        others = ", ".join(f"{n}: {told[n]}" for n in names_of(line) if n not in line["truth"])
        yield Row(line["record"], "", {
            "work": line["work"], "hidden: status": hidden, "other causes: status": others,
            "verdict": line["verdict"],
        })  # fmt: skip
    false = sum(len(verdict_on(line).surely_wrong) for line in lines)
    seconds = float(np.median([line["processor"] for line in lines]))
    yield (f"\n{len(lines)} records: {found} of {every} hidden effects named ({found / max(every, 1):.0%}), "
           f"{false} of {causes} causes confirmed and false ({false / max(causes, 1):.0%}); "
           f"median {seconds:.0f} s of processor")  # fmt: skip
