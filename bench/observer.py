"""Performance of the observer and the pure-torque flag: required and measured values.

Run: python bench/observer.py [SECTION …] [--hours 10] [--seconds 20]
rigs     RMS error of both torques, unlumped and lumped observer, in the same run
effects  the same with each effect of the catalogue in the plant: nominal and extended model
walk     influence of the intensity of the disturbance's random walk
noise    false alarms on the sensors' noise alone, and whether a torque in the band is lost
flag     the flag against the true error |T_p - T_d| / |T_d|, over a table of signals
tight    time of one sample in a loop without other work
timing   time in the node, latency to a third process, CPU; a bare loop in the same run
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.observer_errors import effects, rigs, walk
from bench.observer_flag import noise
from bench.observer_flag_error import flag
from bench.observer_tight import tight
from bench.observer_timing import timing
from bench.sections import choose, parser_of

SECTIONS: dict[str, Callable[[argparse.Namespace], Iterable[str]]] = {
    "rigs": rigs, "effects": effects, "walk": walk, "noise": noise, "flag": flag,
    "tight": tight, "timing": timing,
}  # fmt: skip


def main() -> None:
    """Measure and print."""
    parser = parser_of(__doc__)
    parser.add_argument("--hours", type=float, default=10.0, help="of simulated noise")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each run of the node")
    parser.add_argument("--rate", type=float, nargs="+", default=[280.0, 1000.0], help="of `timing`, Hz")
    parser.add_argument("--priority", type=int, nargs="+", default=[0, 80], help="of `timing`; 0: none")
    args, sections = choose(parser, SECTIONS)
    for name, section in sections:
        print(f"== {name}")
        for line in section(args):
            print(line, flush=True)


if __name__ == "__main__":
    main()
