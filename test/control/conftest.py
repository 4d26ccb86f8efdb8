"""Make `random_rigs` and `slow`, which are no tests, importable for the tests of the controller."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
