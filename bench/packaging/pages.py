"""Size of every kind of page, and its errors in a browser.

The records are of the paper's length, 160 s at 280 Hz. Status 1 when a page without 3-D is larger than
1.5 MB, or a browser logs an error of a page. Some minutes.
"""

from __future__ import annotations

import io
import re
import tempfile
import time
from contextlib import redirect_stdout
from pathlib import Path
from typing import NamedTuple

from watch.browser import Browser

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
READY = "document.readyState === 'complete' && location.protocol === 'file:'"
DRAWN = "[...document.querySelectorAll('.figure')].filter((f) => f.dataset.drawn).length"
OTHERS = "document.querySelectorAll('.heat svg, .spans').length"
SETTLE = 0.5
"""s without another figure after which a page counts as drawn: what is folded away is not."""


def main() -> int:
    """Make the pages, open each, print a row for each."""
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        records(folder)
        print(f"{'page':<16} {'MB':>6}  figures  errors")
        for kind, (verb, *words) in CALLS.items():
            inputs = [str(folder / w) if (folder / w).exists() else w for w in words]
            with redirect_stdout(io.StringIO()):
                rsea([verb, *inputs, "--out", str(folder / verb)])
            page = folder / verb / "report.html"
            opened, size = open_page(page), page.stat().st_size
            wrong += opened.errors > 0 or (size > LARGEST and "3-D" not in kind)
            print(f"{kind:<16} {1e-6 * size:6.3f}  {opened.figures:7d}  {opened.errors:6d}", flush=True)
    return int(wrong > 0)


def records(folder: Path) -> None:
    """Write the bags that are identified and diagnosed."""
    for name, more in (("plain", []), ("rubbing", ["--effect", FRICTION])):
        with redirect_stdout(io.StringIO()):
            rsea(["simulate", RIG, "--duration", "160", *more, "--out", str(folder / name)])


class Opened(NamedTuple):
    """A page in a browser: s until its figures are drawn, their number, requests beyond it, console lines."""

    seconds: float
    figures: int
    requests: int
    errors: int


def open_page(page: Path) -> Opened:
    """Open a page in a headless Chromium of its own."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(Path(profile))
        try:
            begun = time.perf_counter()
            browser.open(page.as_uri(), height=4000)
            browser.until(f"{READY} && {DRAWN} + {OTHERS}")
            figures, drawn_at = 0, time.perf_counter()
            while time.perf_counter() - drawn_at < SETTLE:
                if (now := browser.value(f"{DRAWN} + {OTHERS}")) != figures:
                    figures, drawn_at = now, time.perf_counter()
            seconds = drawn_at - begun
            errors = [error for error in browser.errors if not SOFTWARE_3D.search(error)]
            others = [url for url in browser.requests if not url.startswith(("file:", "data:", "blob:"))]
            return Opened(seconds, figures, len(others), len(errors))
        finally:
            browser.close()
