"""Makes `foreign`, bags written without this project, importable for the tests of the command line."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "msg_adapters"))
