"""Figs. 6, 7 and 8 of the paper as drawings: torque is voltage, velocity is current.

They were drawn once with schemdraw and are kept as SVG beside this file.
"""

from __future__ import annotations

from pathlib import Path

_FOLDER = Path(__file__).parent


def general_circuit() -> str:
    """Return Fig. 6, a series elastic actuator between two loads, as SVG."""
    return _svg("general_circuit")


def lumped_circuit() -> str:
    """Return Fig. 7, both ends fixed: the branches of the loads are open, and one loop is left."""
    return _svg("lumped_circuit")


def epicyclic_circuit() -> str:
    """Return Fig. 8, the epicyclic train as a three-port: two transformers on the rotor's inertia."""
    return _svg("epicyclic_circuit")


def _svg(name: str) -> str:
    return (_FOLDER / f"{name}.svg").read_text(encoding="utf-8").rstrip("\n")
