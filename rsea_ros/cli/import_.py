"""`rsea import`: a measurement of a real machine becomes a bag."""

from __future__ import annotations

import argparse
from pathlib import Path

from msg_adapters import write_record
from msg_adapters.tables import import_record, load_map, summary
from rsea_ros.cli._maps import map_path
from rsea_ros.cli._output import add_force
from rsea_ros.cli._topics import add_topic_options, topic_map
from rsea_ros.new_files import check_free

HELP = "turn a CSV, TSV or MAT file of a real machine into a bag, by a map of columns and units"
EXAMPLE = "rsea import run.csv --map map.yaml --out run"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument(
        "file", help="measurement: .csv, .tsv (also .gz) or .mat (up to version 7); a directory for some maps"
    )
    parser.add_argument("--map", required=True, help="map file (YAML), or the name of one in config/imports")
    parser.add_argument("--out", required=True, help="bag to be made: a directory, or a file .mcap or .db3")
    which = "which joint, from 0, of cells that hold several (name[#] in a map)"
    parser.add_argument("--index", type=int, metavar="N", help=which)
    add_force(parser)
    parser.add_argument("--storage", default="mcap", choices=("mcap", "sqlite3"), help="of a directory")
    add_topic_options(parser)


def run(args: argparse.Namespace) -> int:
    """Write the bag and say what is in it."""
    path = map_path(args.map)
    check_free([Path(args.out)], force=args.force, inputs=[args.file, path])
    mapping = load_map(path)
    record = import_record(args.file, mapping, args.index)
    write_record(record, args.out, topic_map(args), args.storage, force=args.force)
    for line in summary(record, mapping.at(args.index)):
        print(line)
    rate = next(iter(record.channels.values())).rate
    print(f"{args.out}: {record.stop - record.start:.3f} s at {rate:.1f} Hz")
    return 0
