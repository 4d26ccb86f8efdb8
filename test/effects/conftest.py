"""Make `effect_bench` and `independent`, which are no tests, importable for the tests of the effects."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
