"""`rsea fleet run`: new recordings become rows of a store."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, get_args

from rsea_ros.cli._output import FOUND, add_fail_on
from rsea_ros.cli._progress import progress
from rsea_ros.errors import ParameterError
from rsea_ros.fleet.executor import Executor, serial
from rsea_ros.fleet.fleet_error import FleetError
from rsea_ros.fleet.joints import Diagnose, load_joints
from rsea_ros.fleet.summary import RunSummary
from rsea_ros.fleet.time_limit import TIME_LIMIT

if TYPE_CHECKING:
    from rsea_ros.fleet.plan import Held

GIGA, MINUTE = 1e9, 60.0
MOST_SHOWN = 10
"""Largest number of quarantined recordings to print; the store has all."""


def add_run(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `run`."""
    add_work(parser)
    parser.add_argument("--out", required=True, metavar="STORE", help="folder of the store, new or existing")
    add_fail_on(parser, ("refused", "quarantined"), " (of rows that this run writes)")


def add_work(parser: argparse.ArgumentParser) -> None:
    """Declare the options for sources, processing and workers."""
    add = parser.add_argument
    add("sources", nargs="+", metavar="SOURCE", help="folder, bag, pattern in quotes, URL, or @FILE: a list")
    add("--map", required=True, metavar="joints.yaml", help="joint map: rig and topics of each joint")
    add("--diagnose", choices=get_args(Diagnose), help="recordings to diagnose (default: as in the map)")
    add("--pages", action="store_true", help="keep the page of each new diagnosis, for links of the report")
    add("--again", action="store_true", help="retry quarantined recordings")
    limit = "quarantine a recording whose joint takes longer than this (default %(default)g)"
    add("--time-limit", type=float, default=TIME_LIMIT / MINUTE, metavar="MIN", help=limit)
    where = parser.add_argument_group("workers")
    where.add_argument("--workers", type=int, metavar="N", help="processes on this machine (default: cores)")
    where.add_argument("--memory", type=float, metavar="GB", help="of each worker (default: all, shared)")
    where.add_argument("--serial", action="store_true", help="use this process only, without Dask")
    where.add_argument("--scheduler", metavar="ADDRESS", help="use a running Dask cluster: tcp://HOST:PORT")
    dashboard = "address of the Dask dashboard (default %(default)s; port 0: any)"
    where.add_argument("--dashboard", default="127.0.0.1:0", metavar="HOST:PORT", help=dashboard)
    where.add_argument("--no-wait", action="store_true", help="refuse if another run writes to the store")


def run(args: argparse.Namespace) -> int:
    """Process new recordings, and print the outcomes."""
    check_options(args)
    held = bags_in(args)
    if not held:
        expected = "expected .mcap or .db3 files, or tables of the map"
        raise FleetError(f"{', '.join(args.sources)}: no recording, {expected}")
    summary = write_rows(args, args.out, held)
    print(summary.sentence())
    for joint, bag, why in summary.quarantined[:MOST_SHOWN]:
        print(f"quarantined: {joint}: {bag}: {why}")
    for line in summary.unreadable[:MOST_SHOWN]:
        print(f"unreadable, left for the next run: {line}")
    for bag in summary.changed[:MOST_SHOWN]:
        print(f"changed while it was read, left for the next run: {bag}")
    print(f"store: {args.out}; next: rsea fleet report {args.out} --out report")
    return FOUND if set(summary.outcomes).intersection(args.fail_on) else 0


def bags_in(args: argparse.Namespace) -> list[Held]:
    """Return the recordings of the sources with the joints that each holds, diagnosed as the options say."""
    from rsea_ros.fleet.sources import bags_of

    joints = load_joints(args.map)
    if args.diagnose:
        joints = tuple(replace(joint, diagnose=args.diagnose) for joint in joints)
    return bags_of(args.sources, joints)


def write_rows(args: argparse.Namespace, out: str, held: Sequence[Held]) -> RunSummary:
    """Write the rows of all new recordings, and return the outcomes."""
    from rsea_ros.fleet.engine import Engine, EngineLimits
    from rsea_ros.fleet.plan import is_anything_new
    from rsea_ros.fleet.store import hold_lock, open_store
    from rsea_ros.fleet.task import work

    store = open_store(out, create=True)
    with hold_lock(store, None if args.no_wait else _say_waiting):
        store.finish()
        if args.again:
            store.take_out({"quarantined"})
        memory = None if args.serial or args.scheduler else _memory(args)
        limits = EngineLimits(memory, time=args.time_limit * MINUTE, pages=args.pages)
        place = executor(args, memory) if is_anything_new(store, held) else serial()
        with place as places, progress("fleet") as tell:
            return Engine(store, places, work, tell, limits).run(held)


@contextmanager
def executor(args: argparse.Namespace, memory: int | None) -> Iterator[Executor]:
    """Return the executor of the tasks. memory: bytes of each worker on this machine."""
    if args.serial:
        with serial() as process:
            yield process
        return
    from rsea_ros.fleet.cluster import on_scheduler, on_this_machine

    if args.scheduler:
        with on_scheduler(args.scheduler) as scheduler:
            yield scheduler
        return
    assert memory is not None
    with on_this_machine(_workers(args), memory, args.dashboard) as (workers, link):
        print(f"dashboard: {link}", file=sys.stderr, flush=True)
        yield workers


def check_options(args: argparse.Namespace) -> None:
    """Refuse contradictory options before any work."""
    if args.serial and args.scheduler:
        raise ParameterError("--serial and --scheduler: expected one of them")
    if args.workers is not None and args.workers < 1:
        raise ParameterError(f"--workers {args.workers}, expected 1 or more")
    if args.memory is not None and not args.memory > 0.0:
        raise ParameterError(f"--memory {args.memory:g} GB, expected more than 0")
    if not args.time_limit > 0.0:
        raise ParameterError(f"--time-limit {args.time_limit:g} min, expected more than 0")


def _workers(args: argparse.Namespace) -> int:
    from rsea_ros.fleet.cluster import cores

    return args.workers or cores()


def _memory(args: argparse.Namespace) -> int:
    from rsea_ros.fleet.cluster import memory_for

    return int(args.memory * GIGA) if args.memory else memory_for(_workers(args))


def _say_waiting(holder: str) -> None:
    print(f"rsea fleet: {holder} is writing to the store: this run waits until it has ended",
          file=sys.stderr, flush=True)  # fmt: skip
