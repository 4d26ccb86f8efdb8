"""Runs a benchmark: python -m bench TOPIC [SECTION …] [OPTION …]. Without a topic: the topics and sections.

Each run appends its rows to out/results.jsonl, a line of JSON each: topic, section, row, required, measured,
seconds, machine, commit, date. `python -m bench keep TOPIC SECTION` takes the rows of the last run into
bench/kept.jsonl, and `python -m bench pages` writes the tables of docs/ from there.

The signature of a section's function is its command line: keywords are options, the others arguments, and the
lines `name: …` of its text are their help.
"""

import argparse
import importlib
import inspect
import re
import sys
import tempfile
import time
import typing
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import rsea_ros.cli  # noqa: F401  first of all: it keeps numpy from starting threads of its own

# isort: split
from bench.results import Row, add_run, keep_last, write_pages
from bench.topics import EVERY, TOPICS, index


def main(argv: Sequence[str]) -> int:
    """Run what is asked for; status 1 where a benchmark says that a requirement is not met."""
    topic, *rest = argv or ["-h"]
    if topic == "keep" and len(rest) == 2:
        return keep_last(*rest)
    if topic == "pages":
        return write_pages("--check" in rest)
    if topic not in TOPICS:
        print(f"{__doc__}\n" + "\n".join(f"{t:12} {section:16} {what}" for t, section, what in index()))
        return 0 if topic in ("-h", "--help") else 2
    sections = TOPICS[topic]
    most = len(rest) if topic in EVERY else 1
    names = [rest.pop(0) for _ in range(most) if rest and rest[0] in sections]
    names = names or [*sections][: None if topic in EVERY else 1]
    functions = {name: _function(topic, sections[name]) for name in names}
    args = _parser(topic, functions).parse_args(rest)
    return max(_run(topic, name, function, args) for name, function in functions.items())


def _function(topic: str, place: str) -> Callable[..., Any]:
    module, _, function = place.partition(":")
    return typing.cast(
        Callable[..., Any], getattr(importlib.import_module(f"bench.{topic}.{module}"), function or "main")
    )


def _parser(topic: str, functions: dict[str, Callable[..., Any]]) -> argparse.ArgumentParser:
    """Return the parser of what some functions take."""
    texts = [
        sys.modules[f.__module__].__doc__ if f.__name__ == "main" else f.__doc__ for f in functions.values()
    ]
    parser = argparse.ArgumentParser(
        f"python -m bench {topic} {' '.join(functions)}",
        description="\n".join([*filter(None, texts), f"sections: {', '.join(TOPICS[topic])}"]),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    known: set[str] = set()
    for function in functions.values():
        told = dict(re.findall(r"^ *(\w+): (.+)$", function.__doc__ or "", re.MULTILINE))
        kinds = typing.get_type_hints(function, include_extras=True)
        for name, p in _parameters(function).items():
            if name not in known:
                _add(parser, p, kinds.get(name, type(p.default)), told.get(name, ""))
                known.add(name)
    return parser


def _parameters(function: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """Return what a function takes of the command line: all but an empty `folder`."""
    return {n: p for n, p in inspect.signature(function).parameters.items() if n != "folder"}


def _add(parser: argparse.ArgumentParser, p: inspect.Parameter, kind: Any, told: str) -> None:
    """Add an option or argument. kind: its type; Annotated with its choices where it has some."""
    is_option, has_default = p.kind is p.KEYWORD_ONLY, p.default is not p.empty
    name = p.name.rstrip("_").replace("_", "-")
    more: dict[str, Any] = {"dest": p.name} if is_option else {}
    if p.default is False:
        parser.add_argument(f"--{name}", action="store_true", help=told, **more)
        return
    choices: Iterable[str] = ()
    if typing.get_origin(kind) is typing.Annotated:
        kind, choices = typing.get_args(kind)
    kind = next((k for k in typing.get_args(kind) if isinstance(k, type)), kind)
    kind = type(p.default[0]) if kind is tuple else kind
    several = isinstance(p.default, tuple)
    if several or not has_default:
        more["nargs"] = "+" if is_option and several else "*" if several else None
    elif not is_option:
        more["nargs"] = "?"
    more |= {"default": p.default} if has_default else {"required": True} if is_option else {}
    if p.default not in (None, "", (), p.empty):
        told += f" (default {' '.join(map(str, p.default)) if several else p.default})"
    parser.add_argument(
        f"--{name}" if is_option else p.name, help=told.replace("%", "%%"), metavar=name.upper(),
        type=_one_of([*choices]) if choices else kind, **more,
    )  # fmt: skip


def _one_of(choices: Sequence[str]) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text and text not in choices:
            raise argparse.ArgumentTypeError(f"{text!r}, expected one of {', '.join(choices)}")
        return text

    return read


def _run(topic: str, name: str, function: Callable[..., Any], args: argparse.Namespace) -> int:
    """Run a section: print and keep its tables and lines."""
    begin = time.monotonic()
    print(f"== {topic} {name}")
    with tempfile.TemporaryDirectory() as folder:
        arguments = inspect.signature(function).bind_partial()
        given = {"folder": Path(folder), **vars(args)}
        arguments.arguments.update({n: given[n] for n in arguments.signature.parameters})
        tables, status = _print(iter(function(*arguments.args, **arguments.kwargs)))
    add_run(topic, name, tables, time.monotonic() - begin)
    return status


def _print(rows: Iterator[Row | tuple[Any, ...] | str]) -> tuple[list[list[Row]], int]:
    """Print what a section yields; return its tables, or its lines as one, and what it returns at its end."""
    tables, lines, head = list[list[Row]](), list[Row](), tuple[str, ...]()
    while True:
        try:
            row = next(rows)
        except StopIteration as end:
            return tables or [lines], end.value or 0
        if isinstance(row, str):
            head = ()
            lines.append(Row(row.strip(), "", ""))
            print(row, flush=True)
            continue
        row = Row(*row)
        (names, cells), before = row.cells(), head
        head = names
        if head != before:
            tables.append([])
            print(f"\n| {' | '.join(head)} |\n|{'---|' * len(head)}")
        tables[-1].append(row)
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
