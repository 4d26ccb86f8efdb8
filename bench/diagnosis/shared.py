"""The shared cases: bags from a plant outside this repository, with their truth beside them."""

from __future__ import annotations

import json
from collections.abc import Mapping

from independent.hidden import CATALOGUE

from bench import SHARED
from bench.diagnosis.cases import RIG
from bench.diagnosis.played import Played
from msg_adapters import read_record
from rsea_ros.model.rig_file import load_rig

FOLDER = SHARED / "cases"
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


def shared_names() -> list[str]:
    """Return the names of the shared cases, none where the folder is not there."""
    return sorted(f"shared-{folder.name}" for folder in FOLDER.glob("[0-9]*"))


def shared_case(name: str) -> Played:
    """Return a shared case; no second bag of the same bench exists for it."""
    number = name.removeprefix("shared-")
    entry = json.loads((FOLDER / "truth" / "truth.json").read_text())[number]
    causes = tuple(entry["causes"])
    sizes = {cause: _parameters(cause, entry["bench"]) for cause in causes}
    about = {"group": ("clean", "single", "pair")[min(len(causes), 2)]}
    return Played(read_record(FOLDER / number), load_rig(RIG), (), causes, sizes, about=about)


def _parameters(cause: str, bench: Mapping[str, float]) -> dict[str, float]:
    out = {}
    for name in CATALOGUE[cause]:
        for alias in (*PARAMETERS.get(cause, {}).get(name, ()), name):
            if alias in bench:
                out[name] = bench[alias]
                break
    return out
