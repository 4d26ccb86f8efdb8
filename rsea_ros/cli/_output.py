"""Options of every verb that writes: where to, and whether files that exist may be replaced."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path

from rsea_ros.errors import OutputError
from rsea_ros.new_files import Place, check_free

FOUND = 1
"""Exit status for a finding that --fail-on names."""


def add_force(parser: argparse.ArgumentParser) -> None:
    """Declare --force."""
    parser.add_argument("--force", action="store_true", help="replace files that exist (never an input)")


def add_fail_on(parser: argparse.ArgumentParser, findings: Sequence[str], note: str = "") -> None:
    """Declare --fail-on. findings: what it may name; the verb returns FOUND for those."""
    parser.add_argument(
        "--fail-on",
        nargs="+",
        action="extend",
        default=[],
        choices=findings,
        metavar="FINDING",
        help=f"exit status {FOUND} for any of these: {', '.join(findings)}{note}",
    )


def results_place(
    args: argparse.Namespace,
    default: str | Path,
    names: Sequence[str],
    inputs: Iterable[str | Path | None] = (),
) -> Place:
    """Return where a verb's results go: --out, else a name that no other run has (NAME, NAME-2, …).

    Raises OutputError, before any work, where --out is a file, holds results, or is the place of an input.
    """
    if args.out is None:
        return Place(Path(default), fresh=True)
    folder = Path(args.out)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"--out {folder}: is a file, expected a directory or a new name")
    check_free((folder / name for name in names), force=args.force, inputs=list(filter(None, inputs)))
    return Place(folder, args.force)
