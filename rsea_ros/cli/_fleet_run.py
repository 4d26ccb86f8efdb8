"""`rsea fleet run`: new recordings become rows of a store."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from shlex import quote
from typing import TYPE_CHECKING, get_args

from rsea_ros.cli._output import FOUND, add_fail_on
from rsea_ros.cli._terminal import progress
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.fleet.executor import Executor, serial
from rsea_ros.fleet.fleet_error import FleetError
from rsea_ros.fleet.joints import Diagnose, load_joints
from rsea_ros.fleet.summary import RunSummary
from rsea_ros.fleet.task import TIME_LIMIT
from rsea_ros.processes import Stopped

if TYPE_CHECKING:
    from rsea_ros.fleet.store import Store
    from rsea_ros.fleet.task import Held

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
    where.add_argument("--serial", action="store_true", help="use this process only")
    where.add_argument("--scheduler", metavar="ADDRESS", help="use a running Dask cluster: tcp://HOST:PORT")
    where.add_argument("--no-wait", action="store_true", help="refuse if another run writes to the store")


def run(args: argparse.Namespace) -> int:
    """Process new recordings, and print the outcomes."""
    check_options(args)
    held = bags_in(args)
    sources = ", ".join(args.sources)
    if not held:
        raise FleetError(f"{sources}: no recording, expected .mcap or .db3 files, or tables of the map")
    if not any(joints for _, joints in held):
        what = f"{len(held)} recordings, of no joint of {args.map}, such as {held[0][0].url}"
        raise FleetError(f"{sources}: {what}, expected paths that match its bags")
    summary = write_rows(args, args.out, held)
    print(summary.sentence())
    for line in _hints(args, summary, held):
        print(line)
    for joint, bag, why in summary.quarantined[:MOST_SHOWN]:
        print(f"quarantined: {joint}: {bag}: {why}")
    if (more := len(summary.quarantined) - MOST_SHOWN) > 0:
        print(f"quarantined: {more} more, all in the view recordings of rsea fleet sql")
    for line in summary.unreadable[:MOST_SHOWN]:
        print(f"unreadable, left for the next run: {line}")
    for bag in summary.changed[:MOST_SHOWN]:
        print(f"changed while it was read, left for the next run: {bag}")
    print(f"store: {args.out}; next: rsea fleet report {quote(args.out)} --out report")
    return FOUND if set(summary.outcomes).intersection(args.fail_on) else 0


def _hints(args: argparse.Namespace, summary: RunSummary, held: Sequence[Held]) -> Iterator[str]:
    """Yield what is likely a mistake in the map."""
    seen = {joint.name for _, joints in held for joint in joints}
    missing = [joint for joint in load_joints(args.map) if joint.name not in seen]
    for joint in missing[:MOST_SHOWN]:
        yield f"no recording of {joint.name}: no path matches its bags: {', '.join(joint.bags)}"
    if summary.unmapped:
        yield f"of no joint: {summary.example}{' and others' if summary.unmapped > 1 else ''}"
    if summary.undated:
        yield "without a date no trend can be estimated: state in the map, as “date”, how paths contain it"


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
    from rsea_ros.fleet.store import hold_lock, open_store
    from rsea_ros.fleet.task import is_anything_new, work

    store = open_store(out, create=True)
    with hold_lock(store, None if args.no_wait else _say_waiting):
        store.finish()
        if args.again:
            store.take_out({"quarantined"})
        memory = None if args.serial or args.scheduler else _memory(args)
        limits = EngineLimits(memory, time=args.time_limit * MINUTE, pages=args.pages)
        place = executor(args, memory) if is_anything_new(store, held) else serial()
        with _reporting_what_is_left(store, held), place as places, progress("fleet") as tell:
            return Engine(store, places, work, tell, limits).run(held)


@contextmanager
def _reporting_what_is_left(store: Store, held: Sequence[Held]) -> Iterator[None]:
    """Let the report of a signal that stops the block say how many recordings are left."""
    from rsea_ros.fleet.task import count_new

    try:
        yield
    except Stopped as stop:
        with suppress(RseaError, OSError):
            number, all_of = count_new(store, held), sum(len(joints) for _, joints in held)
            stop.note = f"{number} of {all_of} recordings are left, run the same line again"
        raise


@contextmanager
def executor(args: argparse.Namespace, memory: int | None) -> Iterator[Executor]:
    """Return the executor of the tasks. memory: bytes of each worker on this machine."""
    if args.serial:
        with serial() as process:
            yield process
        return
    if args.scheduler:
        from rsea_ros.fleet.cluster import on_scheduler

        with on_scheduler(args.scheduler) as scheduler:
            yield scheduler
        return
    from rsea_ros.fleet.pool import on_this_machine

    assert memory is not None
    with on_this_machine(_workers(args), memory) as workers:
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
    from rsea_ros.fleet.pool import cores

    return args.workers or cores()


def _memory(args: argparse.Namespace) -> int:
    from rsea_ros.fleet.pool import memory_for

    return int(args.memory * GIGA) if args.memory else memory_for(_workers(args))


def _say_waiting(holder: str) -> None:
    print(f"rsea fleet: {holder} is writing to the store: this run waits until it has ended",
          file=sys.stderr, flush=True)  # fmt: skip
