"""Cost of `rsea fleet`, and the failures that it survives, in figures.

Run: python bench/fleet.py cost|faults [PART …]. Ratios and counts do not depend on the machine, seconds do.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import rsea_ros.cli  # noqa: F401  keeps numpy from starting threads


def main(arguments: list[str]) -> int:
    """Run the requested parts."""
    match arguments:
        case ["client", bags, store]:
            from fleet_faults import client

            client(bags, store)
            return 0
        case ["peak", folder]:
            from fleet_memory import print_peak

            print_peak(folder)
            return 0
        case ["faults", *names]:
            from fleet_faults import main as faults

            return faults(names)
        case ["cost", *names]:
            from fleet_cost import main as cost

            return cost(names)
    print(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
