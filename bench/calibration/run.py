"""Make, fit and score the probabilities of causes.

python -m bench calibration make           diagnose records of known truth (resumes)
python -m bench calibration fit            coefficients, from the project's own plants
python -m bench calibration score          reliability, Brier score, wrong names, on the other
"""

from __future__ import annotations

import argparse
import copyreg
import pickle
import time
import traceback
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bench import ROOT, parser_of
from bench.calibration.cases import Plan, left_out, plans, simulate_plan
from bench.calibration.score import (
    JUDGES,
    diagram,
    fit_coefficients,
    probabilities_of,
    reliability,
    rows,
    table,
)
from bench.results import append_line, read_lines
from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.criteria import is_at_floor
from rsea_ros.diagnosis.diagnose import nominal_problem, search
from rsea_ros.diagnosis.evaluation import held_out_data
from rsea_ros.diagnosis.naming.weighing import CauseAndRivals, weigh
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.identification.solver import worker_pools

CACHE = Path("out/calibration/evidence.jsonl")
TABLE = ROOT / "rsea_ros/diagnosis/naming/status.py"


def _read_only(values: dict[str, Any]) -> MappingProxyType[str, Any]:
    return MappingProxyType(values)


copyreg.pickle(MappingProxyType, lambda m: (_read_only, (dict(m),)))  # type: ignore[arg-type]


def main(argv: Sequence[str]) -> int:
    """Run one of the three steps."""
    args = _parser().parse_args(argv)
    return int(args.step(args) or 0)


def _parser() -> argparse.ArgumentParser:
    parser = parser_of(__doc__)
    parser.add_argument("--cache", type=Path, default=CACHE, help="JSON lines, a record each (%(default)s)")
    verbs = parser.add_subparsers(required=True, metavar="make|fit|score")
    make = verbs.add_parser("make", help="diagnose records and keep the evidence; goes on where it stopped")
    make.add_argument("--records", type=int, default=600, help="how many (default %(default)s)")
    make.add_argument("--seed", type=int, default=12, help="of the records; a cache for each (%(default)s)")
    make.add_argument("--searches", type=Path, help="keep the searches here, to weigh them again later")
    make.add_argument(
        "--pool", type=int, default=0, help="try at most N effects a record, 0: all (default %(default)s)"
    )
    make.set_defaults(step=_make)
    verbs.add_parser("fit", help=f"write {TABLE.name} from the project's own plants").set_defaults(step=_fit)
    score = verbs.add_parser("score", help="reliability diagram, Brier score, wrong names")
    score.add_argument("--markdown", type=Path, help="the tables")
    score.add_argument("--svg", type=Path, help="the reliability diagram")
    score.set_defaults(step=_score)
    return parser


def _make(args: argparse.Namespace) -> None:
    """Append the evidence of every record that the cache does not hold yet."""
    done = {entry["name"] for entry in read_lines(args.cache)}
    for plan in plans(args.records, args.seed):
        if plan.name not in done:
            entry = _entry(plan, args.searches, args.pool)
            append_line(args.cache, entry)
            print(_line(entry), flush=True)


def _fit(args: argparse.Namespace) -> None:
    """Fit the coefficients to the plants that do not judge, and write their table."""
    entries = [e for e in usable(args.cache) if e["family"] != JUDGES]
    coefficients = fit_coefficients(*rows(entries))
    items = "".join(f'        "{name}": {value},\n' for name, value in coefficients.items())
    head, _, _ = TABLE.read_text().partition("COEFFICIENTS = ")
    TABLE.write_text(f"{head}COEFFICIENTS = MappingProxyType(\n    {{\n{items}    }}\n)\n")
    print(f"{len(entries)} records of {', '.join(sorted({e['family'] for e in entries}))}: {TABLE}")
    print("\n".join(f"{name:<12}{value:8.3f}" for name, value in coefficients.items()))


def _score(args: argparse.Namespace) -> None:
    """Score the probabilities on the plants that judge, and on those of the fit."""
    text = []
    for title, chosen in (("The plant that judges", True), ("The plants that were fitted to", False)):
        entries = [e for e in usable(args.cache) if (e["family"] == JUDGES) == chosen]
        causes = list(probabilities_of(entries))
        text += [f"**{title}**: {len(entries)} records", "", *table(causes), ""]
        if chosen and args.svg:
            args.svg.write_text(diagram(reliability(causes)))
    print("\n".join(text))
    if args.markdown:
        args.markdown.write_text("\n".join(text))


def usable(cache: Path) -> list[dict[str, Any]]:
    """Return the entries of a cache that ended without an error."""
    return [e for e in read_lines(cache) if "error" not in e]


def _entry(plan: Plan, searches: Path | None, pool: int) -> dict[str, Any]:
    """Return the outcome of one record; an exception is an outcome too."""
    start = time.perf_counter()
    entry = {"name": plan.name, "family": plan.family, "group": plan.group, "truth": list(plan.truth)}
    entry |= {"off": plan.off[0] if plan.off else None, "excitation": plan.excitation, "pool": pool}
    entry["sizes"] = plan.hidden
    try:
        entry |= _weigh(plan, searches, pool)
    except Exception:
        entry["error"] = traceback.format_exc(limit=-3)
    return entry | {"seconds": round(time.perf_counter() - start, 2)}


def _weigh(plan: Plan, searches: Path | None, pool: int) -> dict[str, Any]:
    kept = searches / f"{plan.name}.pickle" if searches else None
    settings = DiagnosisSettings(without=left_out(plan, pool))
    with worker_pools() as pools:
        if kept and kept.exists():
            selection, stages = pickle.loads(kept.read_bytes())
        else:
            record, rig = simulate_plan(plan)
            checked = check(record, rig)
            nominal = nominal_problem([checked], rig)
            selection, stages = search(
                nominal, checked.record, None, pools, lambda step, share: None, settings
            )
            if kept:
                kept.parent.mkdir(parents=True, exist_ok=True)
                kept.write_bytes(pickle.dumps((selection, stages)))
        places = weigh(selection, stages, held_out_data(selection, None), pools, settings)
    return {
        "nothing_wrong": is_at_floor(stages[0].test),
        "at_floor": is_at_floor(stages[-1].test),
        "places": [_place(p) for p in places],
    }


def _place(place: CauseAndRivals) -> list[dict[str, Any]]:
    """Return the evidence for a cause and its rivals, with the size that each has."""
    return [
        asdict(w.evidence) | {"values": _values(w.claim.problem, w.claim.theta, w.claim.name)}
        for w in (place.cause, *place.rivals)
    ]


def _values(problem: Any, theta: Any, name: str) -> dict[str, float]:
    unknowns_of_cause = [
        (u, t) for u, t in zip(problem.unknowns, theta, strict=True) if u.name.startswith(name + ".")
    ]
    return {u.name.split(".")[1]: u.outer(float(t)) for u, t in unknowns_of_cause}


def _line(entry: dict[str, Any]) -> str:
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
