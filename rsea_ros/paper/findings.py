"""Where the paper contradicts itself, is silent, or can be read in two ways, each with its number.

`found` is only what two statements of the paper make impossible together; what it admits, what it says of
another machine, or what rests on an estimate of ours is none.
"""

from __future__ import annotations

from rsea_ros.paper.findings_bench import identification, moving_output, prototype
from rsea_ros.paper.findings_theory import circuit, equations
from rsea_ros.paper.paper_finding import PaperFinding


def findings() -> tuple[PaperFinding, ...]:
    """Return all of them, in the order of the paper."""
    return (*circuit(), *equations(), *identification(), *moving_output(), *prototype())
