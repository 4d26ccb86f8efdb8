"""Make, fit and score the probabilities of causes."""

import time
import traceback
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from bench import ROOT
from bench.calibration import score as scores
from bench.calibration.cases import Plan, plans, simulate_plan
from bench.results import Row, read_lines, resumed
from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.criteria import is_at_floor
from rsea_ros.diagnosis.diagnose import nominal_problem, search
from rsea_ros.diagnosis.evaluation import held_out_data
from rsea_ros.diagnosis.naming.weighing import CauseAndRivals, weigh
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.identification.solver import worker_pools

CACHE = Path("out/calibration/evidence.jsonl")
TABLE = ROOT / "rsea_ros/diagnosis/naming/status.py"


def make(*, cache: Path = CACHE, records: int = 600, seed: int = 12) -> Iterator[str]:
    """Diagnose records of known truth and keep the evidence; goes on where it stopped.

    cache: JSON lines, a record each
    records: how many
    seed: of the records; a cache for each
    """
    works = ((plan.name, partial(_entry, plan)) for plan in plans(records, seed))
    for entry in resumed(cache, works, "name"):
        yield _line(entry)


def fit(*, cache: Path = CACHE) -> Iterator[str]:
    """Fit the coefficients to the plants that do not judge, and write their table.

    cache: JSON lines, a record each
    """
    entries = [e for e in usable(cache) if e["family"] != scores.JUDGES]
    coefficients = scores.fit_coefficients(*scores.rows(entries))
    items = "".join(f'        "{name}": {value},\n' for name, value in coefficients.items())
    head, _, _ = TABLE.read_text().partition("COEFFICIENTS = ")
    TABLE.write_text(f"{head}COEFFICIENTS = MappingProxyType(\n    {{\n{items}    }}\n)\n")
    yield f"{len(entries)} records of {', '.join(sorted({e['family'] for e in entries}))}: {TABLE}"
    yield from (f"{name:<12}{value:8.3f}" for name, value in coefficients.items())


def score(*, cache: Path = CACHE) -> Iterator[Row | str]:
    """Score the probabilities on the plant that judges, and on those of the fit.

    cache: JSON lines, a record each
    """
    for title, chosen in (("The plant that judges", True), ("The plants that were fitted to", False)):
        entries = [e for e in usable(cache) if (e["family"] == scores.JUDGES) == chosen]
        yield f"\n**{title}**: {len(entries)} records"
        yield from scores.table(list(scores.probabilities_of(entries)))


def usable(cache: Path) -> list[dict[str, Any]]:
    """Return the entries of a cache that ended without an error."""
    return [e for e in read_lines(cache) if "error" not in e]


def _entry(plan: Plan) -> dict[str, Any]:
    """Return the outcome of one record; an exception is an outcome too."""
    start = time.perf_counter()
    entry = {"name": plan.name, "family": plan.family, "group": plan.group, "truth": list(plan.truth)}
    entry |= {"off": plan.off[0] if plan.off else None, "excitation": plan.excitation, "sizes": plan.hidden}
    try:
        entry |= _weigh(plan)
    except Exception:
        entry["error"] = traceback.format_exc(limit=-3)
    return entry | {"seconds": round(time.perf_counter() - start, 2)}


def _weigh(plan: Plan) -> dict[str, Any]:
    settings = DiagnosisSettings(without=plan.without)
    with worker_pools() as pools:
        record, rig = simulate_plan(plan)
        checked = check(record, rig)
        nominal = nominal_problem([checked], rig)
        selection, stages = search(nominal, checked.record, None, pools, lambda step, share: None, settings)
        places = weigh(selection, stages, held_out_data(selection, None), pools, settings)
    return {
        "nothing_wrong": is_at_floor(stages[0].test),
        "at_floor": is_at_floor(stages[-1].test),
        "places": [_place(p) for p in places],
    }


def _place(place: CauseAndRivals) -> list[dict[str, Any]]:
    """Return the evidence for a cause and its rivals, with the size that each has."""
    weighed = []
    for w in (place.cause, *place.rivals):
        sizes = zip(w.claim.problem.unknowns, w.claim.theta, strict=True)
        values = {
            u.name.split(".")[1]: u.outer(float(t)) for u, t in sizes if u.name.startswith(f"{w.claim.name}.")
        }
        weighed.append(asdict(w.evidence) | {"values": values})
    return weighed


def _line(entry: Mapping[str, Any]) -> str:
    """Return one record in a line: truth, what was accepted with the spread of its lambda, time."""
    first = [place[0] for place in entry.get("places", [])]
    said = ", ".join(
        f"{e['name']} {'+' if e['name'] in entry['truth'] else 'WRONG'} {e['signature']['overall']:.3f}"
        for e in first
    )
    truth = "+".join([*entry["truth"], *([f"({entry['off']})"] if entry["off"] else [])])
    floor = "at floor" if entry.get("at_floor") else ""
    return f"{entry['name']:<28} {truth or 'nothing':<50} {said} {floor} {entry['seconds']:.0f} s" + (
        f"\n{entry['error']}" if "error" in entry else ""
    )
