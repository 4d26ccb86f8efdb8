"""Runs a benchmark: python -m bench TOPIC [SECTION …] [OPTION …]. Without a topic: the topics and sections.

Each run appends its rows to out/results.jsonl, a line of JSON each: topic, section, row, required, measured,
seconds, machine, commit, date. `python -m bench keep TOPIC SECTION` takes the rows of the last run into
bench/kept.jsonl, and `python -m bench pages` writes the tables of docs/ from there.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from bench import parser_of
from bench.results import Row, add_run, keep_last, tables_of, write_pages
from bench.topics import COMMANDS, PARTS, Parts, index


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
                widths = zip(rows[-1], (58, 22, 0), strict=True)
                print("".join(f"{text!s:{width}} " for text, width in widths), flush=True)
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
