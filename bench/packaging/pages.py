"""Size of every kind of page, and its errors in a browser.

The records are of the paper's length, 160 s at 280 Hz. Status 1 when a page without 3-D is larger than
1.5 MB, or a browser logs an error of a page. Some minutes.
"""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path

from bench import parser_of
from rsea_ros.cli.main import main as rsea

LARGEST = 1_500_000
SOFTWARE_3D = re.compile(r"WebGL|Canvas2D")
"""Warnings of a browser without a graphics processor."""
RIG = "paper_high_impedance"
FRICTION = "coulomb_friction:torque=3"
CALLS = {
    "identification": ["identify", "plain"],
    "diagnosis": ["diagnose", "rubbing"],
    "control": ["control", RIG],
    "design (3-D)": ["design"],
    "paper (3-D)": ["paper"],
}
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--enable-logging=stderr",
    "--virtual-time-budget=20000", "--window-size=1400,4000", "--dump-dom",
)  # fmt: skip


def main(argv: Sequence[str]) -> int:
    """Make the pages, open each, print a row for each."""
    parser = parser_of(__doc__)
    parser.add_argument("--chromium", default=shutil.which("chromium") or "google-chrome")
    browser, wrong = parser.parse_args(argv).chromium, 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        records(folder)
        print(f"{'page':<16} {'MB':>6}  figures  errors")
        for kind, (verb, *words) in CALLS.items():
            inputs = [str(folder / w) if (folder / w).exists() else w for w in words]
            with redirect_stdout(io.StringIO()):
                rsea([verb, *inputs, "--out", str(folder / verb)])
            size, drawn, errors = open_page(folder / verb / "report.html", browser)
            wrong += errors > 0 or (size > LARGEST and "3-D" not in kind)
            print(f"{kind:<16} {1e-6 * size:6.3f}  {drawn:7d}  {errors:6d}", flush=True)
    return int(wrong > 0)


def records(folder: Path) -> None:
    """Write the bags that are identified and diagnosed."""
    for name, more in (("plain", []), ("rubbing", ["--effect", FRICTION])):
        with redirect_stdout(io.StringIO()):
            rsea(["simulate", RIG, "--duration", "160", *more, "--out", str(folder / name)])


def open_page(page: Path, browser: str) -> tuple[int, int, int]:
    """Return a page's bytes, the figures that a browser drew of it, and the lines of its console."""
    words = [browser, *FLAGS, f"--user-data-dir={page.parent / 'profile'}", page.as_uri()]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=True)
    lines = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    console = [line for line in lines if not SOFTWARE_3D.search(line)]
    return page.stat().st_size, done.stdout.count('data-drawn="yes"'), len(console)
