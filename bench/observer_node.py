"""The model node in a process, with the times of its work written down at its end.

RSEA_BENCH_TIMES names the file: a row for each wrench that came alone: when (ns of the monotonic clock), the
whole callback to the last publication, and observer with flag alone, ns.
"""

from __future__ import annotations

import atexit
import os
import sys
import time
from typing import Any

import numpy as np

MARK = "RSEA_BENCH_TIMES"


def main() -> int:
    """Run the node with a note of its times."""
    from rsea_ros.model.observer import Observer
    from rsea_ros.model.pure_torque import PureTorque
    from rsea_ros.nodes import model

    rows: list[tuple[int, int, int]] = []
    spent = [0]

    def noted(kind: Any) -> None:
        original = kind.take

        def take(*args: Any) -> Any:
            begin = time.perf_counter_ns()
            result = original(*args)
            spent[0] += time.perf_counter_ns() - begin
            return result

        kind.take = take

    work = model.Model._work

    def woken(self: model.Model) -> None:
        spent[0], began, begin = 0, self._assess.count, time.perf_counter_ns()
        work(self)
        if self._assess.count == began + 1:
            rows.append((time.monotonic_ns(), time.perf_counter_ns() - begin, spent[0]))

    noted(Observer)
    noted(PureTorque)
    model.Model._work = woken  # type: ignore[method-assign]
    atexit.register(lambda: np.save(os.environ[MARK], np.array(rows, dtype=np.int64)))
    return model.main()


if __name__ == "__main__":
    sys.exit(main())
