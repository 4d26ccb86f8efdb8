"""`rsea fleet watch`: process new recordings as they come, and report each change once."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING

from rsea_ros.cli._fleet_run import add_work, bags_in, check_options, write_rows
from rsea_ros.cli._output import FOUND
from rsea_ros.documents.wording import printable
from rsea_ros.errors import ParameterError, RseaError

if TYPE_CHECKING:
    from rsea_ros.fleet.task import Held


def add_watch(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `watch`."""
    parser.add_argument("store", metavar="STORE", help="folder of the store, new or existing")
    add_work(parser)
    every = "interval between looks at the sources, s (default %(default)s)"
    parser.add_argument("--every", type=float, default=60.0, metavar="S", help=every)
    once = f"look once, for a scheduler such as cron: exit status {FOUND} if there is a new alarm"
    parser.add_argument("--once", action="store_true", help=once)


def run(args: argparse.Namespace) -> int:
    """Look, process, report; with --once a single time."""
    check_options(args)
    if not args.every > 0.0:
        raise ParameterError(f"--every {args.every:g} s, expected more than 0")
    if args.once:
        return FOUND if _look(args, bags_in(args), at_first=True) else 0
    seen: dict[str, str] = {}
    at_first, error_before = True, ""
    while True:
        try:
            held = bags_in(args)
            _look(args, [(bag, joints) for bag, joints in held if seen.get(bag.url) == bag.stamp], at_first)
            seen, at_first, error_before = {bag.url: bag.stamp for bag, _ in held}, False, ""
        except BrokenPipeError:
            raise
        except (RseaError, OSError) as error:
            if at_first:
                raise
            error_before = _say_once(f"{error}", error_before)
        time.sleep(args.every)


def _say_once(text: str, before: str) -> str:
    """Print an error that may pass, as of a share that is away, unless the look before had it; return it."""
    if text != before:
        print(f"rsea fleet: {printable(text)}: looking again", file=sys.stderr, flush=True)
    return text


def _look(args: argparse.Namespace, held: list[Held], at_first: bool) -> int:
    """Process recordings, print news, and return the number of new alarms.

    held: recordings unchanged since the previous look, so that none is still being recorded.
    """
    from rsea_ros.fleet.alarm_files import write_alarms
    from rsea_ros.fleet.store import open_store

    summary = write_rows(args, args.store, held)
    if summary.rows:
        print(summary.sentence(), flush=True)
    alarms = write_alarms(open_store(args.store)) if summary.rows or at_first else []
    for alarm in alarms:
        print(f"alarm: {alarm.text}: {alarm.file}", flush=True)
    return len(alarms)
