"""Benchmarks, by topic: `python -m bench` lists them."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"
"""Cases, plants of other hands and measurements of real machines: beside the repository."""
# The second bench is a part of the tests.
if str(ROOT / "test") not in sys.path:
    sys.path += [str(ROOT / "test"), str(ROOT / "test" / "effects")]
