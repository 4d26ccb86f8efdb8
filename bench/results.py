"""Lines of JSON: of long benches that go on where they stopped, of every run, and the kept ones of the pages.

In a page, the rows of a table below `<!-- rows: TOPIC SECTION -->`, head and rule come from the kept lines:
the first column is the row, `required` what is asked, each other column what was measured under its name.
"""

import json
import math
import platform
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from datetime import datetime, timezone
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

from bench import ROOT
from bench.topics import index

RUNS, KEPT = ROOT / "out" / "results.jsonl", ROOT / "bench" / "kept.jsonl"
PAGES = ROOT / "docs"
MARK = re.compile(r"<!-- rows: (\S+) (\S+) -->\n(\|.*\n)(\|[-:| ]*\n)((?:\|.*\n)*)")


class Row(NamedTuple):
    """A row of a run; measured: a text, or one for each column of a table."""

    row: str
    required: str
    measured: str | Mapping[str, str]

    def cells(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return head and cells of it in a table."""
        each = {"measured": self.measured} if isinstance(self.measured, str) else self.measured
        asked = {"required": self.required} if self.required or isinstance(self.measured, str) else {}
        return ("row", *asked, *each), tuple(map(_cell, (self.row, *asked.values(), *each.values())))


def _cell(text: str) -> str:
    """Return a text as it may stand in a table."""
    return re.sub(r"(?<!\\)\|", r"\\|", text)


def read_lines(path: Path) -> list[dict[str, Any]]:
    """Return the entries of a file of JSON lines; none if it does not exist."""
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()] if path.exists() else []


def append_line(path: Path, entry: Mapping[str, Any]) -> None:
    """Append an entry to a file of JSON lines, and make its folder if it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry, ensure_ascii=False) + "\n")


def resumed(
    log: Path | None, works: Iterable[tuple[Any, Callable[[], Mapping[str, Any]]]], key: str,
    minutes: float = math.inf, jobs: int = 1,
) -> Iterator[Mapping[str, Any]]:  # fmt: skip
    """Do the works that a log lacks, and append their entries; yield each.

    works: what the entry has under `key`, and what makes the entry. minutes: none is begun after that.
    jobs: processes; with several, all works are begun.
    """
    stop = time.monotonic() + 60.0 * minutes
    done = {entry.get(key) for entry in (read_lines(log) if log else ())}
    left = (work for name, work in works if name not in done)
    with ProcessPoolExecutor(jobs) if jobs > 1 else nullcontext() as pool:
        begun = takewhile(lambda _: time.monotonic() < stop, left)
        for entry in pool.map(_done, left) if pool else map(_done, begun):
            if log:
                append_line(log, entry)
            yield entry


def _done(work: Callable[[], Mapping[str, Any]]) -> Mapping[str, Any]:
    return work()


def add_run(topic: str, section: str, tables: Sequence[Sequence[Row]], seconds: float) -> None:
    """Append the rows of a run; those of its second table are of `SECTION.2`."""
    git = ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    run = {
        "seconds": round(seconds, 1), "machine": f"{platform.machine()}, Python {platform.python_version()}",
        "commit": commit, "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }  # fmt: skip
    for number, rows in enumerate(tables, start=1):
        name = section if number == 1 else f"{section}.{number}"
        for row in rows:
            append_line(RUNS, {"topic": topic, "section": name, **row._asdict(), **run})


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", line.strip())[1:-1]]


def keep_last(topic: str, section: str) -> int:
    """Put the rows of the last run of a section in the place of its kept ones; status 2 without a run."""

    def concerns(line: Mapping[str, Any]) -> bool:
        return bool(line["topic"] == topic and line["section"].partition(".")[0] == section)

    runs = [r for r in read_lines(RUNS) if concerns(r)]
    if not runs:
        print(f"{topic} {section}: no run in {RUNS}, expected one before it is kept", file=sys.stderr)
        return 2
    others = [r for r in read_lines(KEPT) if not concerns(r)]
    last = [r for r in runs if r["date"] == runs[-1]["date"]]
    KEPT.write_text("".join(json.dumps(r, ensure_ascii=False) + "\n" for r in (*others, *last)), "utf-8")
    return 0


def write_pages(check: bool = False) -> int:
    """Write the tables of docs/ from the kept rows. check: write nothing, status 1 where one differs."""
    kept, stale = read_lines(KEPT), []
    for page in sorted(PAGES.glob("*.md")):
        before = page.read_text(encoding="utf-8")
        after = MARK.sub(lambda found: _table(found, kept), before)
        if after != before:
            stale.append(page.name)
            if not check:
                page.write_text(after, encoding="utf-8")
    print(", ".join(stale) or "every page is as its rows say")
    return int(check and bool(stale))


def _table(found: re.Match[str], kept: Sequence[Mapping[str, Any]]) -> str:
    topic, section, head, rule, _ = found.groups()
    if (topic, section) == ("bench", "index"):
        every = [(f"`{t}`", {"section": f"`{s}`", "what it measures": what}) for t, s, what in index()]
        kept = [{"topic": topic, "section": section, "row": t, "measured": m} for t, m in every]
    rows = [r for r in kept if (r["topic"], r["section"]) == (topic, section)]
    if not rows:
        raise SystemExit(f"{topic} {section}: no row in {KEPT}, expected those of a table of docs/")
    text = "".join(f"| {' | '.join(map(_cell, _columns(r, _cells(head))))} |\n" for r in rows)
    return f"<!-- rows: {topic} {section} -->\n{head}{rule}{text}"


def _columns(row: Mapping[str, Any], head: Sequence[str]) -> Iterator[str]:
    measured = row["measured"]
    yield row["row"]
    for name in head[1:]:
        if name == "required":
            yield row["required"]
        else:
            yield measured[name] if isinstance(measured, dict) else measured
