"""A benchmark of several sections as a command: it runs the named sections, or all without a name."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import TypeVar

Section = TypeVar("Section")


def parser_of(text: str | None) -> argparse.ArgumentParser:
    """Return a parser that shows a module's text as it stands."""
    return argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)


def choose(
    parser: argparse.ArgumentParser, sections: Mapping[str, Section]
) -> tuple[argparse.Namespace, Iterator[tuple[str, Section]]]:
    """Return the arguments, and name and function of each section that they ask for."""
    parser.add_argument("sections", nargs="*", metavar="SECTION", help=", ".join(sections))
    args = parser.parse_args()
    unknown = set(args.sections) - set(sections)
    if unknown:
        parser.error(f"section {', '.join(unknown)}, expected some of {', '.join(sections)}")
    return args, ((name, sections[name]) for name in args.sections or sections)
