"""Make the second bench, which stands in for a real one, importable as `independent`."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1]))
sys.path.append(str(Path(__file__).parent))  # scripted, which is no test
