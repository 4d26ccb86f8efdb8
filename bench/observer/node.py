"""The model node in a process, with the times of its work written down at its end.

RSEA_BENCH_TIMES names the file: a row for each wrench that came alone: when (ns of the monotonic clock), then
wall and CPU time of the callback to the last publication, and of observer with flag alone, ns.
"""

import atexit
import os
import sys
import time
from typing import Any

import numpy as np

from bench.processes import NOTES
from rsea_ros.model.observer import Observer
from rsea_ros.model.pure_torque_error import ErrorFlag
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.nodes import model


def main() -> int:
    """Run the node with a note of its times."""
    rows: list[tuple[int, ...]] = []
    spent = [0, 0]

    def note(kind: Any, name: str) -> None:
        original = getattr(kind, name)

        def take(*args: Any, **named: Any) -> Any:
            cpu, wall = time.thread_time_ns(), time.perf_counter_ns()
            result = original(*args, **named)
            spent[0] += time.perf_counter_ns() - wall  # without thread_time_ns, which asks the kernel
            spent[1] += time.thread_time_ns() - cpu
            return result

        setattr(kind, name, take)

    work = model.ModelNode._work

    def wake(self: model.ModelNode) -> None:
        spent[:], before = [0, 0], self._assess.count
        wall, cpu = time.perf_counter_ns(), time.thread_time_ns()
        work(self)
        cpu, wall = time.thread_time_ns() - cpu, time.perf_counter_ns() - wall
        if self._assess.count == before + 1:
            rows.append((time.monotonic_ns(), wall, cpu, *spent))

    note(Observer, "_take")
    note(TorqueBand, "take")
    note(ErrorFlag, "take")
    model.ModelNode._work = wake  # type: ignore[method-assign]
    atexit.register(lambda: np.save(os.environ[NOTES], np.array(rows, dtype=np.int64).reshape(-1, 5)))
    return model.main()


if __name__ == "__main__":
    sys.exit(main())
