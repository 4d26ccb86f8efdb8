"""The shared cases: bags from a plant outside this repository, with their truth beside them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

from independent.hidden import CATALOGUE

from bench import SHARED as BESIDE
from bench.diagnosis.cases import Case
from msg_adapters import read_record

SHARED = BESIDE / "cases"

PARAMETERS = {
    "coulomb_friction": {"torque": ("coulomb",)},
    "backlash": {"gap": ("backlash",)},
    "structural_resonance": {
        "frequency": ("par_f",),
        "damping_ratio": ("par_zeta",),
        "participation": ("par_mass",),
    },
    "command_delay": {"delay": ("delay",)},
    "nonlinear_spring": {"cubic": ("k_cubic",)},
    "torque_constant_error": {"gain": ("torque_gain",)},
    "mains_interference": {"amplitude": ("hum",), "frequency": ("hum_f",)},
    "damping_drift": {"relative_change": ("damp_drift",)},
}
"""Parameters that have another name in the truth file."""


def shared_cases(folder: Path = SHARED) -> Iterator[Case]:
    """Yield the shared cases; no second bag of the same bench exists for them."""
    truth = json.loads((folder / "truth" / "truth.json").read_text())
    for number, entry in sorted(truth.items()):
        causes = tuple(entry["causes"])
        parameters = {cause: _parameters(cause, entry["bench"]) for cause in causes}
        group = ("clean", "single", "pair")[min(len(causes), 2)]
        record = read_record(folder / number)
        yield Case(f"shared-{number}", record, causes, parameters, None, group)


def _parameters(cause: str, bench: Mapping[str, float]) -> dict[str, float]:
    out = {}
    for name in CATALOGUE[cause]:
        for alias in (*PARAMETERS.get(cause, {}).get(name, ()), name):
            if alias in bench:
                out[name] = bench[alias]
                break
    return out
