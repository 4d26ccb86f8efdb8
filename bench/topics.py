"""The topics and their sections: which there are, and what each measures."""

import ast
from collections.abc import Iterator, Mapping

from bench import ROOT


def _named(module: str, *functions: str) -> dict[str, str]:
    return {name: f"{module}:{name}" for name in functions}


def _mains(*modules: str) -> dict[str, str]:
    return {name: name for name in modules}


TOPICS: Mapping[str, Mapping[str, str]] = {
    "driver": {
        "timing": "timing:timing", "faults": "faults:faults", "random": "random_faults:random_faults",
        **_named("controller", "controller", "restarts"),
    },
    "observer": {
        "lacks": "lacks:lacks", "tight": "timing:tight", "timing": "timing:timing",
    },
    "health": _named("score", "alarms", "faults"),
    "diagnosis": {
        "score": "score", **_named("edits", "edits"),
        **_mains("intervals", "settings"),
    },
    "frozen": _mains("play", "ablation"),
    "calibration": _named("score", "make", "fit", "score"),
    "control": _mains("tables"),
    "inputs": _mains("score"),
    "mutants": _mains("score"),
    "packaging": _mains("pythons"),
    "peers": _mains("score"),
    "public": _mains("score", "emps"),
}  # fmt: skip
"""By topic the sections, each a `module:function`, or a module's `main`: it yields rows (what, required,
measured) and lines, and returns the exit status. The first is run where none is named."""
EVERY = ("driver", "observer", "health")
"""Topics of which all sections are run where none is named."""


def index() -> Iterator[tuple[str, str, str]]:
    """Yield topic, section and first line of every section, without importing it."""
    for topic, sections in TOPICS.items():
        for name, place in sections.items():
            module, _, function = place.partition(":")
            text = (ROOT / "bench" / topic / f"{module}.py").read_text(encoding="utf-8")
            tree: ast.Module | ast.FunctionDef = ast.parse(text)
            if function:
                tree = next(
                    n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) and n.name == function
                )
            yield topic, name, (ast.get_docstring(tree) or "").partition("\n")[0]
