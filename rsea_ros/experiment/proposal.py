"""The request for a design, and the resulting run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.errors import ParameterError
from rsea_ros.experiment.chance_constraint import Peaks
from rsea_ros.experiment.run_limits import RunLimits
from rsea_ros.experiment.run_shape import FEWEST, Kind, Shape
from rsea_ros.records.record import FloatArray

RATES = (50.0, 1000.0)
"""Hz, least and most commands a second: the rates of the nodes that play a run."""
LONGEST = 600.0
"""s, of a run at most."""


@dataclass(frozen=True)
class DesignRequest:
    """The freedom of a design. rate: Hz. shortest, longest: s. refine: evaluations of the refinement.

    per_run: s of excitation that are as dear as one more run; little of it makes more and shorter runs.
    test: 0 for a run that decides between all causes; else the run is a test, which is to show the others
    although the first seems known: chance with which it must show them to be preferred to a longer one.
    Raises ParameterError for a rate outside RATES and for lengths that no run can have.
    """

    limits: RunLimits
    rate: float = 280.0
    shortest: float = 0.5
    longest: float = 10.0
    probe: float = 2.0
    refine: int = 24
    kinds: tuple[Kind, ...] = ("multisine", "chirp", "steps", "holds")
    per_run: float = 0.5
    test: float = 0.0

    def __post_init__(self) -> None:
        low, high = RATES
        if not low <= self.rate <= high:
            raise ParameterError(f"rate = {self.rate:g} Hz, expected {low:g} to {high:g} Hz")
        if not self.longest <= LONGEST:
            raise ParameterError(f"longest run {self.longest:g} s, expected at most {LONGEST:g} s")
        if not 0.0 < self.shortest <= self.longest:
            raise ParameterError(
                f"longest run {self.longest:g} s, expected at least the shortest of {self.shortest:g} s"
            )
        if self.longest * self.rate < max(FEWEST.values()):
            raise ParameterError(
                f"longest run {self.longest:g} s at {self.rate:g} Hz, "
                f"expected at least {max(FEWEST.values())} samples"
            )


@dataclass(frozen=True)
class Proposal:
    """A run to be played, and its expected results.

    duration: s, of the excitation; command: N m, at `rate` Hz, shape (n,), with rest around it. names,
    table: S_ij with i true and j its rival. hopeless: pairs that no shape tried separates. decided: expected
    share that it decides, in a test of the cases in which the first cause is not true; chances: that it
    decides, for each name, were it true; resolved: share that it decides of what is undecided without it and
    some run separates; sharpened: nats by which it narrows the parameters where one cause is left. peaks: of
    every quantity. tried: shapes that were rated. energy: N^2 m^2 s, the integral of the squared command.
    """

    shape: Shape
    duration: float
    rate: float
    command: FloatArray
    names: tuple[str, ...]
    table: FloatArray
    hopeless: tuple[tuple[str, str], ...]
    decided: float
    chances: tuple[float, ...]
    resolved: float
    sharpened: float
    peaks: Peaks
    tried: int
    energy: float

    @property
    def worst(self) -> tuple[str, str, float] | None:
        """The pair that it separates least of those that can be, with its S; None for a single cause."""
        table = self.table.copy()
        for pair in self.hopeless:
            i, j = (self.names.index(n) for n in pair)
            table[i, j] = table[j, i] = np.inf
        if not np.isfinite(table).any():
            return None
        i, j = divmod(int(np.argmin(table)), len(table))
        return self.names[i], self.names[j], float(table[i, j])
