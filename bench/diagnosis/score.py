"""Measure the diagnosis on records of known cause: the issue's measures, a confusion matrix, every case.

python -m bench diagnosis --cases all --jobs 2 --log out/diagnosis.jsonl     goes on where the log ends
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

from bench.diagnosis.cases import Plan, plan
from bench.diagnosis.measures import markdown
from bench.diagnosis.played import Line, is_right, is_right_or_rival, play, said
from bench.diagnosis.shared import shared_case, shared_names
from bench.results import append_line, read_lines


def main(
    *, cases: Annotated[str, ("shared", "own", "all")] = "all", select: str = "", limit: int = 0,
    seed: int = 2024, jobs: int = 1, log: Path | None = None,
) -> None:  # fmt: skip
    """Run the cases that the log lacks, print each line when it arrives and the summary at the end.

    cases: which records
    select: only cases with this text in name or group
    limit: only so many, spread evenly over all
    seed: of the cases
    jobs: cases at a time
    log: JSON lines, a case each
    """
    works: list[Plan | str] = [*shared_names()] if cases != "own" else []
    works += plan(seed) if cases != "shared" else ()
    works = [w for w in works if select in (w if isinstance(w, str) else f"{w.name} {w.group}")]
    count = min(limit or len(works), len(works))
    chosen = [works[k * len(works) // count] for k in range(count)]
    lines = read_lines(log) if log else []
    done = {line["record"] for line in lines}
    left = [w for w in chosen if (w if isinstance(w, str) else w.name) not in done]
    with closing(_run(left, jobs)) as played:
        for line in played:
            lines.append(dict(line))
            if log:
                append_line(log, line)
            print(f"[{len(lines):3d}/{count}] {_words(line)}", flush=True)
    print("\n".join(markdown(lines)))


def _run(works: list[Plan | str], jobs: int) -> Iterator[Line]:
    """Yield lines as they arrive, from `jobs` processes, or from this one when that is 1."""
    if jobs == 1:
        yield from map(_play, works)
        return
    with ProcessPoolExecutor(jobs) as pool:
        for future in as_completed([pool.submit(_play, work) for work in works]):
            yield future.result()


def _play(work: Plan | str) -> dict[str, Any]:
    """Simulate or read a case where it runs, so that few are in memory, and diagnose it."""
    return play(work, shared_case(work)) if isinstance(work, str) else play(work.name, work.make())


def _words(line: Line) -> str:
    """Return a case in one line: whether it is right, causes, their sizes, gain, time."""
    mark = "ok   " if is_right(line) else "rival" if is_right_or_rival(line) else "WRONG"
    found = line.get("found", ())
    sizes = ", ".join(f"{name} {value:.4g} of {truth:.4g}" for _, name, truth, value, *_ in found)
    text = f"{mark} {line['record']:<46} {said(line)}" + (f" ({sizes})" if sizes else "")
    text += f" gain {line['gain']:.3f}/{line['gain_fresh']:.3f}" if "gain" in line else ""
    text += f" residual {line.get('times_noise', 0.0):.2f} x noise, {line['seconds']:.1f} s"
    return text + f" faults: {', '.join(line['faults_found'])}" * bool(line["faults_found"])
