"""Laws for errors without a name: how well `law` recovers laws that it does not know, on fresh records.

    python -m bench laws --group catalogue --log out/laws.jsonl    each effect taken out in turn
    python -m bench laws --group unknown --log out/laws.jsonl      laws the catalogue never had
    python -m bench laws --group clean --log out/laws.jsonl        benches without anything hidden
    python -m bench laws --group time                              seconds for 160 s of data
    python -m bench laws --table --log out/laws.jsonl              the figures of a log

A run that is stopped goes on where its log ends. gain: 1 - RMS(with) / RMS(without) on a fresh record, all
channels in units of what the base leaves of them.
"""

import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from bench.laws.cases import LawCase, cases
from bench.results import Row, read_lines, resumed
from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.diagnose import nominal_problem
from rsea_ros.diagnosis.score import Score, score
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import lend
from rsea_ros.identification.fit import fit
from rsea_ros.identification.problem import simulate_cases
from rsea_ros.identification.unknowns import apply
from rsea_ros.laws.law import LawResult
from rsea_ros.laws.learn import gain_of, learn
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Record


def main(
    *, group: Annotated[str, ("catalogue", "unknown", "clean", "time")] = "catalogue", select: str = "",
    clean: int = 50, duration: float = 0.0, log: Path = Path("out/laws.jsonl"), table: bool = False,
) -> Iterator[Row | str]:  # fmt: skip
    """Run the cases that the log lacks, or print its figures.

    select: only cases with this text in their name
    clean: clean benches
    duration: of a record, s; 0: 30, and 160 for time
    log: outcomes, one a line
    table: print the figures of the log
    """
    if table:
        yield from figures(read_lines(log))
    elif group == "time":
        yield _time(duration or 160.0)
    else:
        chosen = (c for c in cases(clean) if c.group == group and select in c.name)
        for row in resumed(log, ((c.name, partial(_keep, c, duration or 30.0)) for c in chosen), "name"):
            yield _line(row)


def _keep(case: LawCase, duration: float) -> dict[str, Any]:
    """Return the outcome of a case, or that it broke: one must not stop the others."""
    try:
        return outcome(case, duration)
    except Exception:
        traceback.print_exc()
        return {"name": case.name, "group": case.group, "names": ["broken"]}


def outcome(case: LawCase, duration: float) -> dict[str, Any]:
    """Return the outcome of a case."""
    record, fresh = case.records(duration)
    rig = load_rig(case.rig)
    start = time.process_time()
    result = learn([record], rig)
    seconds = time.process_time() - start
    laws = [w.law for w in result.laws]
    row: dict[str, Any] = {
        "name": case.name, "group": case.group, "seconds": round(seconds, 1), "at_floor": result.at_floor,
        "terms": sum(len(law.parts) for law in laws), "learnt": any(law.is_learnt for law in laws),
        "regressors": [law.regressor for law in laws], "places": [law.place for law in laws],
        "names": [list(law.parameters) for law in laws], "own_gain": round(result.gain, 4),
    }  # fmt: skip
    if case.effect is None:
        return row
    true, gained = fresh_gains(case, result, rig, record, fresh)
    first = [p.term.regressor for law in laws[:1] for p in law.parts] or [law.regressor for law in laws[:1]]
    return {**row, "true_gain": round(true, 4), "gain": round(gained, 4),
            "right": bool(first) and any(r in case.right for r in first)}  # fmt: skip


def fresh_gains(
    case: LawCase, result: LawResult, rig: Rig, record: Record, fresh: Record
) -> tuple[float, float]:
    """Return the gains on the fresh record of the true effect, fitted, and of the law."""
    assert case.effect is not None
    with lend(case.effect, *(w.effect for w in result.laws)):
        true = rig.with_effects(EffectSetting(case.effect.name, dict(case.parameters)))
        base, best, law = (_fit(r, record) for r in (rig, true, result.rig if result.laws else rig))
        scores = [_score(r, fresh, rig) for r in (base, best, law)]
    return gain_of(scores[0], scores[1])[0], gain_of(scores[0], scores[2])[0]


def _fit(rig: Rig, record: Record) -> tuple[Rig, object]:
    """Return a rig refitted to a record with its effects and clocks: `identify` with the law."""
    problem = nominal_problem([check(record, rig)], rig)
    solution, _, _ = fit(problem.cases, rig)
    return apply(solution.problem.rig, solution.problem.unknowns, solution.theta)


def _score(fitted: tuple[Rig, object], fresh: Record, rig: Rig) -> Score:
    """Return the score on all of a fresh record."""
    model, clocks = fitted
    problem = nominal_problem([check(fresh, rig)], rig)
    (outputs,) = simulate_cases(problem.cases, model, clocks)  # type: ignore[arg-type]
    return score(replace(problem, rig=rig), problem.cases, outputs, DEFAULT.blocks)


def _time(duration: float) -> Row:
    case = next(c for c in cases(0) if c.name == "stribeck_friction")
    record, _ = case.records(duration)
    start, used = time.perf_counter(), time.process_time()
    result = learn([record], load_rig(case.rig))
    wall, cpu = time.perf_counter() - start, time.process_time() - used
    told = f"{wall:.1f} s, {cpu:.1f} s of processor; gain {100 * result.gain:.1f} %"
    return Row(f"{duration:g} s of data", "<= 60 s", told)


def _line(row: Mapping[str, Any]) -> str:
    share = ""
    if "true_gain" in row:
        share = f" gain {row['gain']:.3f} of {row['true_gain']:.3f} {'right' if row['right'] else 'WRONG'}"
    law = f"terms {row.get('terms')} {row.get('places')} {row.get('regressors')}"
    return f"{row['name']:<28}{share} {law} {row.get('seconds')} s"


def figures(rows: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    """Yield the figures of a log, required and measured; a case that broke has none of them."""
    for group, share in (("catalogue", 0.9), ("unknown", 0.7)):
        some = [r for r in rows if r["group"] == group]
        if not some:
            continue
        right = [bool(r.get("right")) for r in some]
        enough = [r.get("gain", 0.0) >= share * r.get("true_gain", 1.0) for r in some]
        short = [r.get("terms", 99) <= 5 and not r["learnt"] for r in some]
        whole = np.logical_and.reduce([right, enough, short]) if group == "catalogue" else np.array(right)
        what = "at most 5 terms, gain and regressor" if group == "catalogue" else "regressor"
        yield Row(f"{group}: {what}", ">= 80 %", f"{100 * np.mean(whole):.0f} % of {len(some)}")
        yield Row(f"{group}: right regressor", "", f"{100 * np.mean(right):.0f} %")
        yield Row(f"{group}: at least {share:g} of the true gain", "", f"{100 * np.mean(enough):.0f} %")
    clean = [not r["names"] for r in rows if r["group"] == "clean"]
    if clean:
        told = f"{100 * np.mean(clean):.0f} % of {len(clean)}"
        yield Row("clean benches without a law", ">= 98 %", told)
