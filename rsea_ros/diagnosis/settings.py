"""Settings of a diagnosis that its user may change."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.errors import ParameterError

MOST_CAUSES = 4
"""Beside so many causes the benchmark's records hold too little that is not explained yet for another."""


@dataclass(frozen=True)
class DiagnosisSettings:
    """What a diagnosis tries.

    max_causes: causes at most, 1 or more; the search ends earlier where only noise is left.
    without: effects of the catalogue that are not to be tried.
    Raises ParameterError for a number below 1.
    """

    max_causes: int = MOST_CAUSES
    without: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.max_causes < 1:
            raise ParameterError(f"max_causes = {self.max_causes}, expected 1 or more")
        object.__setattr__(self, "without", tuple(self.without))
