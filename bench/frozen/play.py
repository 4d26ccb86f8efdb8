"""Play records and compare what the diagnosis says of them with the frozen file.

A line for each record: its verdict; of each cause the name, status, probability to 0.01 and sizes to a tenth
of their sigma; seconds; and a digest of every number to the last bit.

    python -m bench frozen play                                    the quick set against the kept lines
    python -m bench frozen play --plants FOLDER --out L.jsonl      generators of another hand, scored
    python -m bench frozen play --plants FOLDER --before L.jsonl   the same after a change
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

from bench.diagnosis.played import Entry, confirmed_of, names_of, play, said
from bench.frozen.cases import SETS, generated
from bench.results import read_lines, resumed

KEPT = Path(__file__).resolve().parent / "kept"
WITHIN = 0.1
"""Sigmas by which a size may differ where two pieces of code became one."""


def score(lines: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the records that are not named rightly and surely, and a last line that counts."""
    right, wrong, sure = [], [], []
    known = [line for line in lines if line.get("truth") is not None]
    for line in known:
        hidden, named, confirmed = set(line["truth"]), set(names_of(line)), confirmed_of(line)
        right.append(named == hidden)
        sure.append(confirmed == hidden)
        wrong.append(not confirmed <= hidden)
        if confirmed != hidden or named != hidden:
            mark = "not so" if confirmed <= hidden else "WRONG"
            yield f"{mark}: {line['record']}, hidden {', '.join(sorted(hidden)) or 'nothing'}; {said(line)}"
    processor = sum(line["processor"] for line in known)
    yield f"{len(known)} records: {sum(right)} with all hidden named and no other, {sum(sure)} with all"\
        f" confirmed, {sum(wrong)} with a wrong one confirmed; {processor:.0f} s of processor"


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


def main(
    *, subset: Annotated[str, SETS] = "quick", exact: bool = False, keep: bool = False,
    minutes: float = math.inf, out: Path | None = None, plants: Path | None = None,
    seeds: tuple[int, ...] = (1,), only: str = "", before: Path | None = None,
) -> int:  # fmt: skip
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
        for line in resumed(log, ((e.name, partial(_made, e)) for e in entries), "record", minutes):
            print(line["record"], flush=True)
        lines = read_lines(log)
    if plants:
        print("\n".join(score(lines)))
    if keep or (plants and not before):
        return 0
    differing = compare(lines, read_lines(kept), exact)
    print("\n".join(differing) or f"{len(lines)} records: all as kept")
    return int(bool(differing))


def _made(entry: Entry) -> dict[str, Any]:
    return play(entry.name, entry.make())
