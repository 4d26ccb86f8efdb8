"""`steps`, `written` and `fleet_histories` importable."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path += [str(HERE), str(HERE.parent / "trends")]
