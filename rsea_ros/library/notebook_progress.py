"""Progress of long work as a bar below a notebook's cell."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from importlib import import_module

from rsea_ros.progress import Progress


@dataclass(frozen=True)
class Bar:
    """The present step, and the share of the work that is done, 0 to 1; empty without a step."""

    step: str = ""
    share: float = 0.0

    def __repr__(self) -> str:
        """Return step and share for a notebook that shows plain text."""
        return f"{self.step}: {100.0 * self.share:.0f} %" if self.step else ""

    def _repr_html_(self) -> str:
        bar = f"<progress value='{self.share:.3f}'></progress> {escape(self.step)}"
        return bar if self.step else ""


@contextmanager
def shown_in_notebook(progress: Progress | None) -> Iterator[Progress | None]:
    """Yield the caller's progress if there is one, else in a notebook a bar that vanishes at the end."""
    if progress is not None or not _is_notebook():
        yield progress
        return
    handle = import_module("IPython.display").display(Bar(), display_id=True)
    try:
        yield lambda step, share: handle.update(Bar(step, share))
    finally:
        handle.update(Bar())


def _is_notebook() -> bool:
    """Return whether a notebook's kernel runs this code; a terminal of IPython has none."""
    if "ipykernel" not in sys.modules:
        return False
    return hasattr(import_module("IPython").get_ipython(), "kernel")
