"""Play records and compare what the diagnosis says of them with the frozen file.

A line for each record: its verdict; of each cause the name, status, probability to 0.01 and sizes to a tenth
of their sigma; seconds; and a digest of every number to the last bit.
"""

import math
import re
from collections.abc import Generator, Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from bench.diagnosis.played import Line, play_all, said, verdict_on
from bench.frozen.cases import SETS, generated
from bench.results import read_lines

KEPT = Path(__file__).resolve().parent / "kept"
WITHIN = 0.1
"""Sigmas by which a size may differ where two pieces of code became one."""


def score(lines: Sequence[Line]) -> Iterator[str]:
    """Yield the records that are not named rightly and surely, and a last line that counts."""
    known = [(line, verdict_on(line)) for line in lines if line.get("truth") is not None]
    right = [not v.missed and not v.wrong for _, v in known]
    for (line, v), is_named in zip(known, right, strict=True):
        if not (v.sure and is_named):
            mark = "WRONG" if v.surely_wrong else "not so"
            hidden = ", ".join(sorted(line["truth"])) or "nothing"
            yield f"{mark}: {line['record']}, hidden {hidden}; {said(line)}"
    sure, wrong = sum(v.sure for _, v in known), sum(bool(v.surely_wrong) for _, v in known)
    processor = sum(line["processor"] for line, _ in known)
    yield f"{len(known)} records: {sum(right)} with all hidden named and no other, {sure} with all"\
        f" confirmed, {wrong} with a wrong one confirmed; {processor:.0f} s of processor"


def compare(lines: Iterable[Line], kept: Iterable[Line], exact: bool) -> list[str]:
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


def _differences(now: Line, before: Line, exact: bool) -> Iterator[str]:
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


def main(
    *, subset: Annotated[str, SETS] = "quick", exact: bool = False, keep: bool = False,
    minutes: float = math.inf, out: Path | None = None, plants: Path | None = None,
    seeds: tuple[int, ...] = (1,), only: str = "", before: Path | None = None,
) -> Generator[str, None, int]:  # fmt: skip
    """Play a set and compare it with the kept file, or keep it; status 1 where something differs.

    subset: the records
    exact: compare to the last bit
    keep: play what the kept file lacks, and keep it
    minutes: then stop; the next run goes on
    out: lines of this run; goes on where they end
    plants: a folder of generators of another hand in place of a set; what is said is held against their truth
    seeds: of these records
    only: those whose names have this pattern in them
    before: lines of an earlier run to compare with, in place of the kept ones
    """
    kept = before or KEPT / f"{subset}.jsonl"
    entries = [e for e in (generated(plants, seeds) if plants else SETS[subset]()) if re.search(only, e.name)]
    with TemporaryDirectory() as folder:
        log = kept if keep and not plants else out or Path(folder) / "lines.jsonl"
        yield from play_all(entries, log, minutes=minutes)
        lines = read_lines(log)
    if plants:
        yield from score(lines)
    if keep or (plants and not before):
        return 0
    differing = compare(lines, read_lines(kept), exact)
    yield from differing or [f"{len(lines)} records: all as kept"]
    return int(bool(differing))
