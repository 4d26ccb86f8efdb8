"""Make `benches`, which is no test, importable for the tests of the identification."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
