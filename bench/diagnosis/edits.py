"""The edit test on a plant of other code: each cause is taken out of the machine, and the model predicts it.

Record A has one or two hidden effects. One that the diagnosis names is deleted from machine and model,
nothing is fitted, and a fresh run is predicted. Error: RMS over that of a fresh run of the unedited machine.

    python -m bench diagnosis edits [--seed 1] [--minutes 8]      resumes
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from independent.bench import drawn_bench, record_run
from independent.severities import SIZES, drawn_parameters

from bench import ROOT
from bench.diagnosis.cases import PAIRS, RIG, hide_all
from bench.results import Row, read_lines, resumed
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.edit import edited
from rsea_ros.diagnosis.result import SAME
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig_file import load_rig

LEAST = 0.9
"""Share of the causes whose model predicts the edited machine as well as its own."""


def edits(
    *, seed: int = 1, minutes: float = 8.0, duration: float = 30.0, log: Path | None = None
) -> Iterator[Row | str]:
    """Play single effects of medium size, then pairs.

    seed: of machines, sizes and runs
    minutes: begin no record after that
    duration: of records, s
    log: JSON lines, a record each
    """
    log = log or ROOT / "out" / f"edits-{seed}.jsonl"
    records = (*((name,) for name in SIZES), *PAIRS)
    works = (("+".join(hidden), partial(_played, hidden, seed, duration)) for hidden in records)
    for entry in resumed(log, works, "record", minutes):
        yield f"{entry['record']}: {entry['causes'] or entry['named']}"
    told = [cause for entry in read_lines(log) for cause in entry["causes"]]
    good = sum(line["after"] <= SAME for line in told)
    median = {k: f"{np.median([line[k] for line in told]):.3g}" for k in ("before", "after", "dense")}
    yield Row("causes named and taken out", "", str(len(told)))
    yield Row("predicted as well as the own machine", f">= {LEAST:.0%}", f"{good / max(1, len(told)):.1%}")
    yield Row("median error: with the cause, without it, dense fit", "", ", ".join(median.values()))


def _played(hidden: tuple[str, ...], seed: int, duration: float) -> dict[str, object]:
    """Return what is named, and the errors for each hidden effect of that, `confirmed` or not."""
    rng = np.random.default_rng([seed, *map(ord, "+".join(hidden))])
    plant = drawn_bench(rng)
    effects = {name: drawn_parameters(name, "medium", rng) for name in hidden}
    runs = [int(s) for s in rng.integers(1, 2**31, 3)]
    machine = hide_all(plant, effects)
    result = diagnose([record_run(machine, runs[0], duration=duration)], load_rig(RIG))
    named = {c.name: c for c in result.causes}
    causes = []
    for name in named.keys() & effects.keys():
        rest = hide_all(plant, {n: p for n, p in effects.items() if n != name})
        edit = edited(result, record_run(rest, runs[1], duration=duration), name)
        fresh = predict(record_run(machine, runs[2], duration=duration), result.extended_rig)
        own = fresh[edit.channel].rms_error
        errors = {"before": edit.error_before, "after": edit.error_after, "dense": edit.error_dense_fit}
        told = {"cause": name, "status": named[name].status, "channel": edit.channel}
        causes.append(told | {k: round(v / own, 3) for k, v in errors.items()})
    return {"record": "+".join(hidden), "named": list(named), "causes": causes}
