"""`rsea import`: convert a measurement of a real machine to a bag."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from shlex import quote

from msg_adapters import write_record
from msg_adapters.tables import Imported, ImportMap, guess_map, import_records, load_map, summary
from rsea_ros.cli import _options, _terminal
from rsea_ros.cli.maps import map_path
from rsea_ros.errors import OutputError, ParameterError
from rsea_ros.outputs.files import Destination, NewFiles, check_free, write_file

HELP = "convert a measurement (CSV, MAT, Parquet, NPZ, JSON) to a bag by a map of its columns"
EXAMPLE = "rsea import run.csv --map map.yaml --out run"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "files", nargs="+", metavar="FILE",
        help="measurements: .csv, .tsv or other text (also .gz), .mat (up to version 7), .parquet, .npz, "
        ".npy, .json, .jsonl; a directory for some maps",
    )  # fmt: skip
    kind = parser.add_mutually_exclusive_group(required=True)
    kind.add_argument("--map", help="map file (YAML), or the name of one in config/imports")
    kind.add_argument("--guess", metavar="MAP", help="write a first map for FILE, a text, with its questions")
    out = (
        "bag to write: a directory, a file .mcap or .db3; for several files, joints or runs a folder of bags"
    )
    parser.add_argument("--out", help=out)
    which = (
        "numbers of the joints in the place of # in the map's columns (q[#], from 0; J# torque): 2, "
        "or 0,1,2, or 0-5"
    )
    parser.add_argument("--index", type=_terminal.whole_numbers, default=(None,), metavar="N", help=which)
    _options.add_force(parser)
    storage = "format of a bag that is a directory (default mcap)"
    parser.add_argument("--storage", default="mcap", choices=("mcap", "sqlite3"), help=storage)
    _options.add_topic_options(parser)


def run(args: argparse.Namespace) -> int:
    if args.guess:
        return _guess(args.files, Path(args.guess), args.force)
    if args.out is None:
        raise ParameterError("no --out, expected a name for the bag")
    path = map_path(args.map)
    check_free([Path(args.out)], force=args.force, inputs=[*args.files, path])
    mapping = load_map(path)
    if len(args.files) == len(args.index) == 1 and mapping.runs is None:
        (imported,) = import_records(args.files[0], mapping, args.index)
        write_record(imported.record, args.out, _options.topic_map(args), args.storage, force=args.force)
        lines = list(_lines_on(imported, args.out))
    else:
        lines = _write_several(args, mapping)
    for line in lines:
        _terminal.say(line, indent=2)
    return 0


def _guess(files: list[str], path: Path, force: bool) -> int:
    if len(files) > 1:
        raise ParameterError(f"--guess: {len(files)} files, expected one: its map may serve the others")
    check_free([path], force=force, inputs=files)
    text = guess_map(files[0])
    write_file(path, text, force=force)
    _terminal.say(f"{path}: a ? where the file says nothing, {text.count('?') - 1} times")
    print(f"next: rsea import {quote(files[0])} --map {quote(str(path))} --out {quote(Path(files[0]).stem)}")
    return 0


def _write_several(args: argparse.Namespace, mapping: ImportMap) -> list[str]:
    """Write a bag for each file, joint and run, all or none, and return their contents."""
    folder, names = Path(args.out), set[str]()
    lines: list[str] = []
    if folder.suffix in (".mcap", ".db3"):
        raise OutputError(f"{folder}: is one bag, expected a folder for several")
    with NewFiles(Destination(folder, args.force)) as new:
        for file in args.files:
            for imported in import_records(file, mapping, args.index):
                name = Path(file).name.partition(".")[0] + imported.name
                if name in names:
                    raise OutputError(f"{folder / name}: is the bag of two inputs, expected other file names")
                names.add(name)
                write_record(imported.record, new.stage(name), _options.topic_map(args), args.storage)
                lines += _lines_on(imported, folder / name)
    return lines


def _lines_on(imported: Imported, out: str | Path) -> Iterator[str]:
    record = imported.record
    yield from summary(record, imported.mapping)
    rate = next(iter(record.channels.values())).rate
    yield f"{out}: {record.stop - record.start:.3f} s at {rate:.1f} Hz"
