"""Where results go, and where they come from."""

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rsea_ros.errors import OutputError
from rsea_ros.model.rig_file import rig_path
from rsea_ros.outputs.files import Destination, check_free, unused_path
from rsea_ros.report.result_files import Provenance, provenance_of


class Action(NamedTuple):
    """What a verb can do: `rsea fleet run`. help: one line. add: declares its arguments. run: as a verb's."""

    help: str
    add: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def verb_of(
    actions: Mapping[str, Action],
) -> tuple[Callable[[argparse.ArgumentParser], None], Callable[[argparse.Namespace], int]]:
    """Return `add_arguments` and `run` of a verb with these actions."""

    def add_arguments(parser: argparse.ArgumentParser) -> None:
        added = parser.add_subparsers(dest="action", required=True, metavar="|".join(actions))
        for name, action in actions.items():
            action.add(added.add_parser(name, help=action.help, description=action.help))

    return add_arguments, lambda args: actions[args.action].run(args)


FOUND = 1
"""Exit status for a finding listed in --fail-on."""


def add_force(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--force", action="store_true", help="replace existing files (never an input)")


def path(text: str) -> Path:
    """Return a path. Raises ArgumentTypeError for an empty one, which would be the working directory."""
    if not text:
        raise argparse.ArgumentTypeError("'', expected a name")
    return Path(text)


def add_results(parser: argparse.ArgumentParser, files: str, default: str) -> None:
    """Declare --out, the directory for the files, and --force. default: where they go without --out."""
    parser.add_argument("--out", type=path, help=f"directory for {files} (default {default}, -2, …)")
    add_force(parser)


def add_json(parser: argparse.ArgumentParser, file: str) -> None:
    """Declare --json: the file of the results on standard output."""
    parser.add_argument("--json", action="store_true", help=f"print {file} to stdout and nothing else")


def print_file(path: Path) -> None:
    print(path.read_text(encoding="utf-8"), end="")


def add_fail_on(parser: argparse.ArgumentParser, findings: Sequence[str], note: str = "") -> None:
    """Declare --fail-on. findings: its possible values; the verb returns FOUND for them."""
    about = f"exit status {FOUND} for any of these: {', '.join(findings)}{note}"
    add = parser.add_argument
    add("--fail-on", nargs="+", action="extend", default=[], choices=findings, metavar="FINDING", help=about)


def results_place(
    args: argparse.Namespace, default: str | Path, names: Sequence[str],
    inputs: Iterable[str | Path | None] = (),
) -> Destination:  # fmt: skip
    """Return the folder of the results: --out, else a free name (NAME, NAME-2, …).

    Raises OutputError, before any work, if --out is a file or a symbolic link, holds results, or is the
    folder of an input.
    """
    if args.out is None:
        check_free([unused_path(Path(default))], inputs=list(filter(None, inputs)))
        return Destination(Path(default), fresh=True)
    folder = Path(args.out)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"--out {folder}: is a file, expected a directory or a new name")
    if folder.is_symlink():
        raise OutputError(f"--out {folder}: is a symbolic link, expected a directory or a new name")
    check_free((folder / name for name in names), force=args.force, inputs=list(filter(None, inputs)))
    return Destination(folder, args.force)


def provenance(verb: str, files: Sequence[str | Path], rig: str = "") -> Provenance:
    """Return version, date and command line, with the hashes of some files and of a rig, if there is one."""
    inputs = [*map(Path, files), *([rig_path(rig)] if rig else [])]
    return provenance_of(["rsea", verb, *sys.argv[2:]], inputs)
