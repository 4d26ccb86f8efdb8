"""`rsea fleet`: many bags, joints and months. New recordings become rows of a store, at once (run) or as they
come (watch); pages (report) and queries (sql) of a store."""

import argparse
import csv
import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import replace
from datetime import date, datetime
from pathlib import Path
from shlex import quote
from typing import Any, get_args

from rsea_extras.fleet import FleetError, pool, task
from rsea_extras.fleet.engine import Engine, EngineLimits, RunSummary
from rsea_extras.fleet.joints import Diagnose, load_joints
from rsea_extras.fleet.sources import bags_of
from rsea_extras.fleet.store import Store, hold_lock, open_store
from rsea_ros import RseaError
from rsea_ros.extension.base import ParameterError, Stopped, printable
from rsea_ros.extension.page import strict
from rsea_ros.extension.verb import (
    FOUND,
    Action,
    add_fail_on,
    add_force,
    columns,
    progress,
    results_place,
    verb_of,
)

HELP = "process bags of many joints: store (run), reports (report), alarms (watch), queries (sql)"
EXAMPLE = "rsea fleet run recordings --map joints.yaml --out store && rsea fleet report store --out report"
GIGA, MINUTE = 1e9, 60.0
MOST_SHOWN = 10
"""Largest number of quarantined recordings to print; the store has all."""
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_WIDEST = 60
"""Largest width of a cell on a terminal, characters."""


def _add_work(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("sources", nargs="+", metavar="SOURCE", help="folder, bag, pattern in quotes, URL, or @FILE: a list")
    add("--map", required=True, metavar="joints.yaml", help="joint map: rig and topics of each joint")
    add("--diagnose", choices=get_args(Diagnose), help="recordings to diagnose (default: as in the map)")
    add("--pages", action="store_true", help="keep the page of each new diagnosis, for links of the report")
    add("--again", action="store_true", help="retry quarantined recordings")
    limit = "quarantine a recording whose joint takes longer than this (default %(default)g)"
    add("--time-limit", type=float, default=task.TIME_LIMIT / MINUTE, metavar="MIN", help=limit)
    add = parser.add_argument_group("workers").add_argument
    add("--workers", type=int, metavar="N", help="processes on this machine (default: cores)")
    add("--memory", type=float, metavar="GB", help="of each worker (default: all, shared)")
    add("--serial", action="store_true", help="use this process only")
    add("--scheduler", metavar="ADDRESS", help="use a running Dask cluster: tcp://HOST:PORT")
    add("--no-wait", action="store_true", help="refuse if another run writes to the store")


def _check_work(args: argparse.Namespace) -> None:
    if args.serial and args.scheduler:
        raise ParameterError("--serial and --scheduler: expected one of them")
    if args.workers is not None and args.workers < 1:
        raise ParameterError(f"--workers {args.workers}, expected 1 or more")
    if args.memory is not None and not args.memory > 0.0:
        raise ParameterError(f"--memory {args.memory:g} GB, expected more than 0")
    if not args.time_limit > 0.0:
        raise ParameterError(f"--time-limit {args.time_limit:g} min, expected more than 0")


def _add_run(parser: argparse.ArgumentParser) -> None:
    _add_work(parser)
    parser.add_argument("--out", required=True, metavar="STORE", help="folder of the store, new or existing")
    add_fail_on(parser, ("refused", "quarantined"), " (of rows that this run writes)")


def _run(args: argparse.Namespace) -> int:
    _check_work(args)
    held = _recordings(args)
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


def _hints(args: argparse.Namespace, summary: RunSummary, held: Sequence[task.Held]) -> Iterator[str]:
    seen = {joint.name for _, joints in held for joint in joints}
    missing = [joint for joint in load_joints(args.map) if joint.name not in seen]
    for joint in missing[:MOST_SHOWN]:
        yield f"no recording of {joint.name}: no path matches its bags: {', '.join(joint.bags)}"
    if summary.unmapped:
        yield f"of no joint: {summary.example}{' and others' if summary.unmapped > 1 else ''}"
    if summary.undated:
        yield "without a date no trend can be estimated: state in the map, as “date”, how paths contain it"


def _recordings(args: argparse.Namespace) -> list[task.Held]:
    """Return the recordings of the sources with the joints that each holds, diagnosed as the options say."""
    joints = load_joints(args.map)
    if args.diagnose:
        joints = tuple(replace(joint, diagnose=args.diagnose) for joint in joints)
    return bags_of(args.sources, joints)


def write_rows(args: argparse.Namespace, out: str, held: Sequence[task.Held]) -> RunSummary:
    store = open_store(out, create=True)
    with hold_lock(store, None if args.no_wait else _say_waiting):
        store.finish()
        if args.again:
            store.take_out({"quarantined"})
        workers, memory = 0, None
        if not (args.serial or args.scheduler):
            workers = args.workers or len(os.sched_getaffinity(0))
            memory = int(args.memory * GIGA) if args.memory else pool.memory_for(workers)
        limits = EngineLimits(memory, time=args.time_limit * MINUTE, pages=args.pages)
        is_new = any(task.are_new(store, held))
        place = _executor(args, workers, memory) if is_new else nullcontext(pool.Serial())
        with _reporting_what_is_left(store, held), place as places, progress("fleet") as tell:
            return Engine(store, places, task.work, tell, limits).run(held)


@contextmanager
def _reporting_what_is_left(store: Store, held: Sequence[task.Held]) -> Iterator[None]:
    """Let the report of a signal that stops the block say how many recordings are left."""
    try:
        yield
    except Stopped as stop:
        with suppress(RseaError, OSError):
            number, all_of = sum(task.are_new(store, held)), sum(len(joints) for _, joints in held)
            stop.note = f"{number} of {all_of} recordings are left, run the same line again"
        raise


def _executor(
    args: argparse.Namespace, workers: int, memory: int | None
) -> AbstractContextManager[pool.Executor]:
    """Return the executor of the tasks. memory: bytes of each worker on this machine."""
    if args.scheduler:
        from rsea_extras.fleet.cluster import on_scheduler

        return on_scheduler(args.scheduler)
    return nullcontext(pool.Serial()) if memory is None else pool.on_this_machine(workers, memory)


def _say_waiting(holder: str) -> None:
    print(f"rsea fleet: {holder} is writing to the store: this run waits until it has ended",
          file=sys.stderr, flush=True)  # fmt: skip


def _add_report(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("store", help="folder of the store")
    parser.add_argument("--out", help="folder of the pages (default out/fleet-STORE, -2, …)")
    add_force(parser)


def _report(args: argparse.Namespace) -> int:
    from rsea_extras.fleet import history, recordings
    from rsea_extras.pages.page import INDEX, write_fleet_report

    place = results_place(args, Path("out") / f"fleet-{Path(args.store).name}", (INDEX,))
    page = write_fleet_report(history(args.store), recordings(args.store), place, store=args.store)
    print(f"report: {page}")
    return 0


def _add_watch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("store", metavar="STORE", help="folder of the store, new or existing")
    _add_work(parser)
    every = "interval between looks at the sources, s (default %(default)s)"
    parser.add_argument("--every", type=float, default=60.0, metavar="S", help=every)
    once = f"look once, for a scheduler such as cron: exit status {FOUND} if there is a new alarm"
    parser.add_argument("--once", action="store_true", help=once)


def _watch(args: argparse.Namespace) -> int:
    """Process new recordings as they come, and report each change once; with --once look a single time."""
    _check_work(args)
    if not args.every > 0.0:
        raise ParameterError(f"--every {args.every:g} s, expected more than 0")
    if args.once:
        return FOUND if _look(args, _recordings(args), at_first=True) else 0
    seen: dict[str, str] = {}
    at_first, error_before = True, ""
    while True:
        try:
            held = _recordings(args)
            _look(args, [(bag, joints) for bag, joints in held if seen.get(bag.url) == bag.stamp], at_first)
            seen, at_first, error_before = {bag.url: bag.stamp for bag, _ in held}, False, ""
        except BrokenPipeError:
            raise
        except (RseaError, OSError) as error:  # one that may pass, as of a share that is away: said once
            if at_first:
                raise
            if str(error) != error_before:
                print(f"rsea fleet: {printable(str(error))}: looking again", file=sys.stderr, flush=True)
            error_before = str(error)
        time.sleep(args.every)


def _look(args: argparse.Namespace, held: list[task.Held], at_first: bool) -> int:
    """Process recordings, print news, and return the number of new alarms.

    held: recordings unchanged since the previous look, so that none is still being recorded.
    """
    from rsea_extras.fleet.alarm_files import write_alarms
    summary = write_rows(args, args.store, held)
    if summary.rows:
        print(summary.sentence(), flush=True)
    alarms = write_alarms(open_store(args.store)) if summary.rows or at_first else []
    for file, text in alarms:
        print(f"alarm: {text}: {file}", flush=True)
    return len(alarms)


def _add_sql(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "query", help="SELECT … FROM recordings, parameters, causes, faults or analyses (docs/fleet.md)"
    )
    parser.add_argument("--store", required=True, help="folder of the store")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print a list of JSON objects")
    form.add_argument("--csv", action="store_true", help="print CSV: a line of names, then one line per row")


def _sql(args: argparse.Namespace) -> int:
    from rsea_extras.fleet.query import answer

    names, rows = answer(open_store(args.store), args.query)
    if args.json:
        print(_json([dict(zip(names, row, strict=True)) for row in rows], indent=1))
    elif args.csv:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(map(no_formula, names))
        writer.writerows([no_formula(value) for value in row] for row in rows)
    else:
        print(columns([names, *([_cell(value) for value in row] for row in rows)]))
    return 0


def no_formula(value: Any) -> str:
    """Return a value in full; a text that a spreadsheet would run begins with an apostrophe."""
    text = _text(value)
    return f"'{text}" if isinstance(value, str) and text.startswith(_FORMULA) else text


def _json(value: Any, indent: int | None = None) -> str:
    return json.dumps(strict(value), default=_other, indent=indent, allow_nan=False, ensure_ascii=False)


def _other(value: Any) -> str:
    return value.isoformat() if isinstance(value, date) else str(value)


def _text(value: Any) -> str:
    plain = strict(value)
    if plain is None:
        return ""
    return _json(plain) if isinstance(plain, (bool, int, float, list, dict)) else _other(plain)


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, datetime):
        return value.strftime("%Y-%m-%d %H:%M:%S")
    text = " ".join(_text(value).split())
    return text if len(text) <= _WIDEST else f"{text[: _WIDEST - 1]}…"


ACTIONS = {
    "run": Action("process new recordings, on all cores or a cluster", _add_run, _run),
    "report": Action("write pages of the fleet and of each joint", _add_report, _report),
    "watch": Action("run at intervals and report changes", _add_watch, _watch),
    "sql": Action("query the store", _add_sql, _sql),
}
add_arguments, run = verb_of(ACTIONS)
