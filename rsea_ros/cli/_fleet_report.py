"""`rsea fleet report`: pages of a store."""

from __future__ import annotations

import argparse
from pathlib import Path

from rsea_ros.cli._output import add_force, results_place


def add_report(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `report`."""
    parser.add_argument("store", help="folder of the store")
    parser.add_argument("--out", help="folder of the pages (default out/fleet-STORE, -2, …)")
    add_force(parser)


def run(args: argparse.Namespace) -> int:
    """Write the pages and print their path."""
    from rsea_ros.fleet import history, recordings
    from rsea_ros.report.fleet.page import INDEX, write_fleet_report

    place = results_place(args, Path("out") / f"fleet-{Path(args.store).name}", (INDEX,))
    page = write_fleet_report(history(args.store), recordings(args.store), place, store=args.store)
    print(f"report: {page}")
    return 0
