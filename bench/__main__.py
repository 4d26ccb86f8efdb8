"""Runs a benchmark: python -m bench TOPIC [SECTION …] [OPTION …]. Without a topic: the topics and sections.

Each run appends its rows to out/results.jsonl, a line of JSON each: topic, section, row, required, measured,
seconds, machine, commit, date. `python -m bench keep TOPIC SECTION` takes the rows of the last run into
bench/kept.jsonl, and `python -m bench pages` writes the tables of docs/ from there.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bench import ROOT, parser_of
from bench.results import Row, add_run, keep_last, tables_of, write_pages


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
         "stream": "stream:stream", "fuzz": "fuzz:fuzz"},
        {"seconds": 30.0, **NODES, "strings": 1_000_000, "minutes": 1.0, "seed": 1, "patient": False},
    ),
    "observer": Parts(
        {"rigs": "errors:rigs", "effects": "errors:effects", "walk": "errors:walk", "sines": "flag:sines",
         "noise": "flag:noise", "flag": "flag_error:flag", "tight": "tight:tight", "timing": "timing:timing"},
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


def main(argv: Sequence[str]) -> int:
    """Run what is asked for; status 1 where a benchmark says that a requirement is not met."""
    topic, *rest = argv or ["-h"]
    if topic in PARTS:
        return _run_parts(topic, PARTS[topic], rest)
    if topic in COMMANDS:
        name = rest.pop(0) if rest and rest[0] in COMMANDS[topic] else COMMANDS[topic][0]
        return _run_command(topic, name, rest)
    if topic == "keep" and len(rest) == 2:
        return keep_last(*rest)
    if topic == "pages":
        return write_pages("--check" in rest)
    print(f"{__doc__}\n" + "\n".join(f"{t:12} {section:16} {what}" for t, section, what in index()))
    return 0 if topic in ("-h", "--help") else 2


def index() -> Iterable[tuple[str, str, str]]:
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
    tree: ast.AST = ast.parse(path.read_text(encoding="utf-8"))
    if function:
        tree = next(n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef) and n.name == function)
    return (ast.get_docstring(tree) or "").partition("\n")[0]  # type: ignore[arg-type]


def _run_parts(topic: str, parts: Parts, argv: Sequence[str]) -> int:
    parser = parser_of(f"{topic}: {', '.join(parts.functions)}; all of them without a name")
    parser.add_argument("sections", nargs="*", metavar="SECTION")
    for name, default in parts.options.items():
        if isinstance(default, bool):
            parser.add_argument(f"--{name}", action="store_true")
        elif isinstance(default, tuple):
            parser.add_argument(f"--{name}", type=type(default[0]), nargs="+", default=list(default))
        else:
            parser.add_argument(f"--{name}", type=type(default), default=default)
    args = parser.parse_args(argv)
    if unknown := set(args.sections) - set(parts.functions):
        parser.error(f"section {', '.join(unknown)}, expected some of {', '.join(parts.functions)}")
    for name in args.sections or parts.functions:
        begin, (module, function) = time.monotonic(), parts.functions[name].split(":")
        section: Callable[..., Iterable[Any]] = getattr(_module(topic, module), function)
        print(f"== {name}")
        rows: list[Row] = []
        with tempfile.TemporaryDirectory() as folder:
            for row in section(args, Path(folder)) if topic == "driver" else section(args):
                rows.append(Row(*row) if isinstance(row, tuple) else Row(row, "", ""))
                print("".join(f"{text:{width}} " for text, width in zip(rows[-1], (58, 22, 0), strict=True)),
                      flush=True)  # fmt: skip
        add_run(topic, name, [rows], time.monotonic() - begin)
    return 0


class _Both(io.StringIO):
    """Text that is printed and kept."""

    def write(self, text: str) -> int:
        if sys.__stdout__ is not None:
            sys.__stdout__.write(text)
            sys.__stdout__.flush()
        return super().write(text)


def _run_command(topic: str, name: str, argv: Sequence[str]) -> int:
    begin, said = time.monotonic(), _Both()
    sys.argv[0] = f"python -m bench {topic} {name}"
    with contextlib.redirect_stdout(said):
        status = _module(topic, name).main(argv) or 0
    add_run(topic, name, tables_of(said.getvalue()), time.monotonic() - begin)
    return int(status)


def _module(topic: str, name: str) -> Any:
    return importlib.import_module(f"bench.{topic}.{name}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
