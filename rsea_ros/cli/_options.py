"""Options that verbs share: where results go, and the runs, topics, part and rig that they come from."""

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePath
from typing import NamedTuple

from msg_adapters.topic_map import AXES, ROLES, TopicMap
from rsea_ros.errors import OutputError, ParameterError
from rsea_ros.identification.result import Remark
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import RigChoice, load_conditions, load_rig, rig_path
from rsea_ros.outputs.files import Destination, check_free, unused_path
from rsea_ros.records.record import Channel, Record
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


def add_topic_options(parser: argparse.ArgumentParser, window: bool = False) -> None:
    """Declare --namespace, --topic, --joint and --axis; with `window` those of a part of a record."""
    default, axes = TopicMap(), ", ".join(AXES)
    add = parser.add_argument_group("topics of another machine").add_argument
    add("--namespace", default=default.namespace, help="namespace of the topics (default %(default)s)")
    about = f"another topic name; ROLE: {', '.join(ROLES)}; TOPIC[2]: the third of numbers without names"
    add("--topic", action="append", default=[], metavar="ROLE=TOPIC", help=about)
    add("--joint", help="name of the joint, if the messages hold several")
    add("--axis", default=default.axis, help=f"actuator axis of the wrench: {axes}; a leading - reverses it")
    if window:
        add = parser.add_argument_group("a part of the record, s since its first stamp").add_argument
        add("--from", dest="begin", type=float, metavar="S", help="leave out samples before S")
        add("--to", dest="end", type=float, metavar="S", help="leave out samples after S")
        add("--window", metavar="A:B", help="the same as --from A --to B")
        about = "add S seconds to the stamps of a channel that another clock has stamped"
        add("--shift", action="append", default=[], metavar="CHANNEL=S", help=about)
        add("--keep-rows", action="store_true", help="leave no row out for its stamps")


def topic_map(args: argparse.Namespace) -> TopicMap:
    """Return the topic map of the options. Raises ParameterError for an impossible one."""
    return TopicMap(namespace=args.namespace, joint=args.joint, axis=args.axis).with_topics(args.topic)


def _given(args: argparse.Namespace, names: Mapping[str, str | None]) -> Iterator[str]:
    """Yield options as they were given: in one word each, since a value may begin with a minus.

    names: attribute of each, and its default.
    """
    for name, default in names.items():
        if (value := getattr(args, name)) is not None and value != default:
            yield f"--{ {'begin': 'from', 'end': 'to'}.get(name, name)}={value}"


def each_once(bags: Sequence[str]) -> Sequence[str]:
    """Return the bags. Raises ParameterError for a bag given twice, whose samples would count twice."""
    places = [os.path.realpath(bag) for bag in bags]
    for bag, place in zip(bags, places, strict=True):
        if places.count(place) > 1:
            raise ParameterError(f"{bag}: given twice, expected each bag once")
    return bags


def cut(record: Record, args: argparse.Namespace) -> Record:
    """Return the part of a record selected by the options; stamps keep their origin except for --shift.

    Which channels cover the whole of it is for the checks to say again.
    Raises ParameterError for an invalid or empty window, and for a shift of an unknown channel.
    """
    record = replace(_shift_stamps(record, args.shift), keeps_rows=args.keep_rows)
    begin, end = _window(args)
    if begin == -math.inf and end == math.inf:
        return record
    part = record.between(record.start + begin, record.start + end)
    channels = {name: channel for name, channel in part.channels.items() if len(channel)}
    if not channels or ("command" in record and "command" not in channels):
        length = record.stop - record.start
        raise ParameterError(
            f"window {begin:g} to {end:g} s: no sample of {record.source} (0 to {length:.3f} s), "
            "expected some commands"
        )
    faults = tuple(f for f in part.faults if f.kind != "partly_recorded")
    return replace(part, channels=channels, faults=faults)


def _shift_stamps(record: Record, shifts: Sequence[str]) -> Record:
    """Return the record with shifted stamps of some channels. shifts: CHANNEL=S each."""
    for shift in shifts:
        name, _, text = shift.partition("=")
        try:
            seconds = float(text)
        except ValueError:
            seconds = math.nan
        if name not in record or not math.isfinite(seconds):
            known = ", ".join(record.channels)
            raise ParameterError(f"--shift {shift}: expected CHANNEL=S, S in s, CHANNEL one of {known}")
        channel = Channel(record[name].t + seconds, record[name].y)
        _check_beside_others(record, name, channel, shift)
        record = record.with_channels(**{name: channel})
    return record


def _check_beside_others(record: Record, name: str, channel: Channel, shift: str) -> None:
    """Raise ParameterError for a shift after which a channel has no moment in common with the others."""
    others = [c for n, c in record.channels.items() if n != name and len(c)]
    if not others or not len(channel):
        return
    start, stop = (float(limit(c.t[at] for c in others)) for limit, at in ((min, 0), (max, -1)))
    if channel.t[0] > stop or channel.t[-1] < start:
        raise ParameterError(
            f"--shift {shift}: moves {name} to {channel.t[0]:.4g} to {channel.t[-1]:.4g} s, "
            f"expected a moment in common with the other channels, {start:.4g} to {stop:.4g} s"
        )


def _window(args: argparse.Namespace) -> tuple[float, float]:
    begin, end = args.begin, args.end
    if args.window is not None:
        if begin is not None or end is not None:
            raise ParameterError(f"--window {args.window}: expected it without --from and --to")
        first, colon, last = args.window.partition(":")
        try:
            begin, end = (float(side) if side else None for side in (first, last))
        except ValueError:
            colon = ""
        if not colon:
            raise ParameterError(f"--window {args.window}: expected A:B in s, such as 5:20")
    begin, end = -math.inf if begin is None else begin, math.inf if end is None else end
    if not begin < end:
        raise ParameterError(f"window {begin:g} to {end:g} s: expected a beginning before its end")
    return begin, end


RIG = "paper_high_impedance"
"""The rig of a verb that is not given one."""
OFF_RIG = "off_rig"
"""Finding of --fail-on: a fitted value is far from the rig's."""


class _Default(str):
    """A rig that was not given."""

    __slots__ = ()


def add_runs(
    parser: argparse.ArgumentParser, several: str = "",
    rig: str = "rig file, or the name of one in config/rigs",
) -> None:  # fmt: skip
    """Declare the bags and --rig. several: what more than one bag are. rig: what is expected."""
    about = f"rosbag2 directory, .mcap or .db3{f'; {several}' if several else ''}"
    parser.add_argument("bags", nargs="+", metavar="BAG", help=about)
    parser.add_argument("--rig", default=_Default(RIG), help=f"{rig} (default %(default)s)")


def add_conditions(parser: argparse.ArgumentParser) -> None:
    """Declare --conditions."""
    about = "YAML file: what is known to differ between the runs, such as a payload (docs/rig.md)"
    parser.add_argument("--conditions", nargs=1, default=(), metavar="FILE", help=about)


def rig_of(args: argparse.Namespace, *others: str | None) -> Rig:
    """Return the rig of a verb with --conditions. others: runs beside its bags."""
    rig, names = load_rig(args.rig), [PurePath(run).name for run in (*args.bags, *others) if run]
    return load_conditions(args.conditions[0], rig, names) if args.conditions else rig


def rig_choice(args: argparse.Namespace) -> RigChoice:
    """Return how the rig and the data of a verb with --rig were chosen."""
    default = TopicMap()
    names = {"namespace": default.namespace, "joint": None, "axis": default.axis}
    topics = (*_given(args, names), *(f"--topic={topic}" for topic in args.topic))
    keep = ("--keep-rows",) if args.keep_rows else ()
    shifts = (f"--shift={shift}" for shift in args.shift)
    part = (*_given(args, dict.fromkeys(("begin", "end", "window"))), *shifts, *keep)
    conditions = "".join(getattr(args, "conditions", ()))
    return RigChoice(args.rig, isinstance(args.rig, _Default), topics, part, conditions)


def off_rig(remarks: Iterable[Remark]) -> list[str]:
    """Return the finding that a value is far from the rig's, if one is."""
    return [OFF_RIG] if any(r.code == OFF_RIG for r in remarks) else []
