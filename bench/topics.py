"""The topics and their sections: which there are, their options, and what each measures."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from bench import ROOT


class Parts(NamedTuple):
    """Sections of a topic that share their options: by name `module:function`, and the options' defaults.

    A function takes the options and yields lines of text, or rows: what, required, measured.
    """

    functions: Mapping[str, str]
    options: Mapping[str, Any]


NODES: Mapping[str, Any] = {"rate": (280.0, 1000.0), "priority": (0, 80)}
PARTS: Mapping[str, Parts] = {
    "driver": Parts(
        {"timing": "timing:timing", "loss": "loss:loss", "faults": "faults:faults",
         "random": "random_faults:random_faults", "controller": "controller:controller",
         "restarts": "controller:restarts",
         "stream": "stream:stream", "fuzz": "fuzz:fuzz"},
        {"seconds": 30.0, **NODES, "strings": 1_000_000, "minutes": 1.0, "seed": 1},
    ),
    "observer": Parts(
        {"rigs": "errors:rigs", "lacks": "lacks:lacks", "noise": "flag:noise",
         "flag": "flag_error:flag", "tight": "tight:tight", "timing": "timing:timing"},
        {"hours": 10.0, "seconds": 20.0, **NODES},
    ),
    "health": Parts(
        {name: f"score:{name}" for name in ("white", "alarms", "faults", "cost", "node")},
        {"hours": 0.5, "seeds": (0, 1, 2), "seconds": 30.0, "rate": 280.0},
    ),
}  # fmt: skip
COMMANDS: Mapping[str, Sequence[str]] = {
    "diagnosis": ("score", "coverage", "overlap", "intervals", "settings",
                  "model_doubt", "mujoco"),
    "frozen": ("play", "ablation"),
    "calibration": ("run",),
    "control": ("tables", "nodes"),
    "experiment": ("score",),
    "fleet": ("cost", "faults", "trends", "trends_played", "pages"),
    "inputs": ("score",),
    "laws": ("score", "real"),
    "mutants": ("score",),
    "packaging": ("pythons", "pages", "exports", "watch"),
    "peers": ("score",),
    "public": ("score", "emps"),
}  # fmt: skip
"""Programs of a topic, each with a `main(argv)`; the first is run where none is named."""


def index() -> Iterator[tuple[str, str, str]]:
    """Yield topic, section and first line of every section."""
    for topic, parts in PARTS.items():
        for name, place in parts.functions.items():
            yield topic, name, _first_line(topic, *place.split(":"))
    for topic, names in COMMANDS.items():
        for name in names:
            yield topic, name, _first_line(topic, name)


def _first_line(topic: str, module: str, function: str = "") -> str:
    """Return the first line of a module's text, or of a function in it, without importing it."""
    path = ROOT / "bench" / topic / f"{module}.py"
    tree: ast.Module | ast.FunctionDef = ast.parse(path.read_text(encoding="utf-8"))
    if function:
        tree = next(n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) and n.name == function)
    return (ast.get_docstring(tree) or "").partition("\n")[0]
