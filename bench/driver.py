"""Performance of the driver on a simulated bench, beside a bare loop with absolute deadlines.

Run: python bench/driver.py [SECTION …] [--seconds 30] [--strings 1000000] [--rate 280 1000] [--priority 0 80]
The sections: timing, loss, faults, random, controller, stream, fuzz; all of them without a name. `random
--minutes 30 --seed 1` is the long one of faults, `timing --rate 280 --seconds 600` the long soak. A machine
that is busy or virtual stalls both loops: look at the ratios.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.driver_controller import controller
from bench.driver_faults import faults
from bench.driver_fuzz import fuzz
from bench.driver_loss import loss
from bench.driver_random import random_faults
from bench.driver_stream import stream
from bench.driver_timing import timing
from bench.sections import choose, parser_of

SECTIONS: dict[str, Callable[[argparse.Namespace, Path], Iterable[tuple[str, str, str]]]] = {
    "timing": timing,
    "loss": loss,
    "faults": faults,
    "random": random_faults,
    "controller": controller,
    "stream": stream,
    "fuzz": fuzz,
}


def main() -> None:
    """Measure, and print required and measured values."""
    parser = parser_of(__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="of each run of the loop")
    parser.add_argument("--rate", type=float, nargs="+", default=[280.0, 1000.0], help="of `timing`, Hz")
    parser.add_argument("--priority", type=int, nargs="+", default=[0, 80], help="of `timing`; 0: none")
    parser.add_argument("--strings", type=int, default=1_000_000, help="damaged byte strings")
    parser.add_argument("--minutes", type=float, default=1.0, help="of `random`")
    parser.add_argument("--seed", type=int, default=1, help="of `random`")
    parser.add_argument("--patient", action="store_true", help="`controller`: late replies are no fault")
    args, sections = choose(parser, SECTIONS)
    print(f"{'what':58} {'required':22} measured")
    for _, section in sections:
        with tempfile.TemporaryDirectory() as folder:
            for row in section(args, Path(folder)):
                print(f"{row[0]:58} {row[1]:22} {row[2]}", flush=True)


if __name__ == "__main__":
    main()
