"""Play records and compare what the diagnosis says of them with the frozen file.

A line for each record: its verdict; of each cause the name, status, probability to 0.01 and sizes to a tenth
of their sigma; seconds; and a digest of every number to the last bit.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bench import parser_of
from bench.frozen.cases import SETS, Entry
from bench.results import append_line, read_lines
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import CauseParameter, Diagnosis
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.errors import RseaError
from rsea_ros.records.statistics import Z95

KEPT = Path(__file__).resolve().parent / "kept"
WITHIN = 0.1
"""Sigmas by which a size may differ where two pieces of code became one."""


def line_of(name: str, result: Diagnosis, seconds: float) -> dict[str, Any]:
    """Return the line of a record."""
    causes = [
        {"name": c.name, "status": c.status, "p": round(c.probability, 2),
         "sizes": {n: _size(p) for n, p in c.parameters.items()}}
        for c in result.causes
    ]  # fmt: skip
    exact = [result.verdict, *(
        [c.name, c.status, c.probability.hex(), *(p.value.hex() for p in c.parameters.values())]
        for c in result.causes
    )]  # fmt: skip
    digest = hashlib.sha256(json.dumps(exact).encode()).hexdigest()[:12]
    return {"record": name, "verdict": result.verdict, "causes": causes, "digest": digest,
            "seconds": round(seconds, 1)}  # fmt: skip


def _size(p: CauseParameter) -> list[float]:
    """Return a size, rounded to a tenth of its sigma, and that sigma."""
    sigma = (p.ci95[1] - p.ci95[0]) / (2.0 * Z95)
    if not math.isfinite(sigma) or sigma <= 0.0:
        return [float(f"{p.value:.6g}"), 0.0]
    digits = max(0, -math.floor(math.log10(0.1 * sigma)))
    return [round(p.value, digits), float(f"{sigma:.2g}")]


def play(entry: Entry) -> dict[str, Any]:
    """Diagnose a record and return its line; an error is its verdict."""
    played = entry.make()
    begin = time.perf_counter()
    try:
        settings = replace(DEFAULT, without=played.without)
        result = diagnose([played.record], played.rig, settings=settings)
    except RseaError as error:
        said = f"error: {error}"
        return {"record": entry.name, "verdict": said, "causes": [], "digest": "", "seconds": 0.0}
    return line_of(entry.name, result, time.perf_counter() - begin)


def record(chosen: str, path: Path, minutes: float = math.inf) -> list[dict[str, Any]]:
    """Append to a file the lines of a set that it lacks, for some minutes; return all lines of the file."""
    stop = time.monotonic() + 60.0 * minutes
    done = {line["record"] for line in read_lines(path)}
    for entry in SETS[chosen]():
        if entry.name not in done and time.monotonic() < stop:
            append_line(path, play(entry))
            print(f"{entry.name}", flush=True)
    return read_lines(path)


def compare(lines: Iterable[Mapping[str, Any]], kept: Iterable[Mapping[str, Any]], exact: bool) -> list[str]:
    """Return a sentence for each record whose line differs from the kept one of its name.

    exact: to the last bit; else names, statuses and verdict alike, probabilities within 0.01 and sizes within
    a tenth of a sigma.
    """
    before = {line["record"]: line for line in kept}
    return [
        f"{now['record']}: {what}"
        for now in lines
        for what in (_differences(now, before[now["record"]], exact) if now["record"] in before else ["new"])
    ]


def _differences(now: Mapping[str, Any], before: Mapping[str, Any], exact: bool) -> Iterator[str]:
    if said(now) != said(before):
        yield f"{said(before)} -> {said(now)}"
    elif exact and now["digest"] != before["digest"]:
        yield "the same words, other digits"
    elif not exact:
        for a, b in zip(before["causes"], now["causes"], strict=True):
            if abs(a["p"] - b["p"]) > 0.0101:
                yield f"{a['name']}: probability {a['p']} -> {b['p']}"
            for n, (value, sigma) in a["sizes"].items():
                new = b["sizes"].get(n, [math.nan])[0]
                if not abs(new - value) <= 2.0 * WITHIN * sigma + 1e-9 * abs(value):  # each is rounded
                    yield f"{a['name']}.{n}: {value:g} -> {new:g}, sigma {sigma:g}"


def said(line: Mapping[str, Any]) -> str:
    """Return verdict, names and statuses of a line."""
    names = ", ".join(f"{c['name']} ({c['status']})" for c in line["causes"])
    return f"{line['verdict']}: {names or 'no cause'}"


def main(argv: Sequence[str]) -> int:
    """Play a set and compare it with the kept file, or keep it; status 1 where something differs."""
    parser = parser_of(__doc__)
    parser.add_argument("--subset", choices=SETS, default="quick", help="the records (default %(default)s)")
    parser.add_argument("--exact", action="store_true", help="compare to the last bit")
    parser.add_argument("--keep", action="store_true", help="play what the kept file lacks, and keep it")
    parser.add_argument("--minutes", type=float, default=math.inf, help="then stop; the next run goes on")
    parser.add_argument("--out", type=Path, help="lines of this run; goes on where they end")
    args = parser.parse_args(argv)
    kept = KEPT / f"{args.subset}.jsonl"
    if args.keep:
        print(f"{len(record(args.subset, kept, args.minutes))} records kept in {kept.name}")
        return 0
    with TemporaryDirectory() as folder:
        lines = record(args.subset, args.out or Path(folder) / kept.name, args.minutes)
    differing = compare(lines, read_lines(kept), args.exact)
    print("\n".join(differing) or f"{len(lines)} records: all as kept")
    return int(bool(differing))
