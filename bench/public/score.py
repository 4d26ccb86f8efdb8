"""The public benchmarks, by the project's own simulation, effects and solver: nonlinearbenchmark.org.

Data: ../shared/realdata, beside the repository; download and licences: nonlinearbenchmark.org.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable

from bench.public import boucwen, emps, silverbox
from bench.public.fit import DATA, Score

HEAD = "| test | error here | published | required |  | s |\n|---|---|---|---|---|---|\n"


def main() -> int:
    """Print the table; 1 where a limit is not reached, 2 without the data."""
    if not DATA.is_dir():
        print(f"{DATA}: no such folder, expected the measurements of real machines", file=sys.stderr)
        return 2
    timed = [_time(part.scores) for part in (emps, silverbox, boucwen)]
    rows = [_row(score, seconds) for scores, seconds in timed for score in scores]
    table = HEAD + "\n".join(rows) + "\n"
    print(table)
    return int(any(s.error > s.asked for scores, _ in timed for s in scores))


def _time(run: Callable[[], list[Score]]) -> tuple[list[Score], float]:
    """Return scores and the processor time that they took, s."""
    start = time.process_time()
    return run(), time.process_time() - start


def _row(score: Score, seconds: float) -> str:
    reached = "reached" if score.error <= score.asked else "**not reached**"
    error, asked = (f"{v:.3g} {score.unit}" for v in (score.error, score.asked))
    if math.isinf(score.asked):
        asked = reached = ""
    return f"| {score.test} | {error} | {score.published} | {asked} | {reached} | {seconds:.0f} |"
