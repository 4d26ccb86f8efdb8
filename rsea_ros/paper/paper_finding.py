"""One finding about the paper."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.paper.claims import Status


@dataclass(frozen=True)
class PaperFinding:
    """found: two statements that cannot both hold. silent: what is left out. unclear: two readings."""

    status: Status
    where: str
    text: str
