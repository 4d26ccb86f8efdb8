"""What every peer shares: it reads a case, and writes what it predicts.

    python common.py NAME CASE.npz RESULT.json BUDGET

A case has t (s), u (input), y (output to be predicted), position, velocity (empty where not measured), each
of shape (n,), `split` (index of the first held-out sample) and `meta` (JSON: physics and stated values). A
script fits to the samples before `split` and predicts y from there on by a free run: u is known, no y is.
BUDGET: processor seconds. Only numpy is needed, so that every peer's environment has it.
"""

import importlib
import json
import sys
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Array = Any


@dataclass(frozen=True)
class PeerCase:
    """A case as a peer sees it; values after `split` of y, position and velocity are not a number."""

    t: Array
    u: Array
    y: Array
    position: Array
    velocity: Array
    split: int
    meta: dict[str, Any]
    budget: float
    started: float = field(default_factory=time.process_time)

    @property
    def period(self) -> float:
        """Sample period, s."""
        return float(np.median(np.diff(self.t)))

    @property
    def seconds_left(self) -> float:
        """Processor seconds of the budget that are left."""
        return self.budget - (time.process_time() - self.started)


@dataclass(frozen=True)
class PeerResult:
    """What a peer returns: y from `split` on, values where they are physical, the cause if it names one."""

    prediction: Array
    parameters: dict[str, float] = field(default_factory=dict)
    cause: str = ""
    note: str = ""


class NotApplicable(Exception):
    """A case that a peer has no model for; its text is the reason."""


def main(name: str, source: str, target: str, budget: str) -> None:
    """Run a peer, MODULE:FUNCTION, on a case."""
    module, _, function = name.partition(":")
    fit = getattr(importlib.import_module(module), function)
    data = np.load(source)
    arrays = (np.array(data[n]) for n in ("t", "u", "y", "position", "velocity"))
    case = PeerCase(*arrays, int(data["split"]), json.loads(str(data["meta"])), float(budget))
    try:
        result = fit(case)
    except NotApplicable as reason:
        contents: dict[str, Any] = {"not_run": str(reason)}
    else:
        contents = {
            "prediction": [float(v) for v in np.ravel(result.prediction)],
            "parameters": result.parameters,
            "cause": result.cause,
            "note": result.note,
        }
    contents["seconds"] = time.process_time() - case.started
    with open(target, "w", encoding="utf-8") as file:
        json.dump(contents, file)


if __name__ == "__main__":
    from common import main as run_peer  # under the name by which the peers know its classes

    run_peer(*sys.argv[1:])
