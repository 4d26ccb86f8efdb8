"""`rsea rig`: start a new rig, and check a rig file."""

import argparse
from pathlib import Path
from shlex import quote

from rsea_ros.cli import _options, _terminal
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import list_names
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.rig_file import load_rig, packaged
from rsea_ros.outputs.files import check_free, write_file

HELP = "start a rig for your bench (new), or check a rig and show its values (check)"
EXAMPLE = "rsea rig new my_bench && rsea rig check my_bench.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="new|check")
    new = actions.add_parser("new", help="write a rig to fill in, with every common key explained")
    new.add_argument("name", help="name of the rig; the file is NAME.yaml unless --out states another")
    new.add_argument("--out", type=_options.path, help="file to write")
    _options.add_force(new)
    check = actions.add_parser("check", help="read a rig and show its values with units, and the free values")
    check.add_argument("rig", help="a file, or the name of a rig that comes with the package")


def run(args: argparse.Namespace) -> int:
    return _new(args) if args.action == "new" else _check(args)


def _new(args: argparse.Namespace) -> int:
    if not args.name.isidentifier():
        raise ParameterError(f"name {args.name!r}, expected letters, digits and _, such as left_knee")
    template = packaged("template", "rig", "templates", ParameterError)
    out = args.out or Path(f"{args.name}.yaml")
    check_free([out], force=args.force)
    write_file(out, template.read_text(encoding="utf-8").replace("NAME", args.name), force=args.force)
    load_rig(out)
    print(f"{out}: fill in the values, then: rsea rig check {quote(str(out))}")
    return 0


def _check(args: argparse.Namespace) -> int:
    rig = load_rig(args.rig)
    _terminal.say(f"{rig.name}: {rig.about}" if rig.about else rig.name, indent=2)
    rows = [_row(rig, name) for name in sorted(rig.quantities)]
    print(_terminal.columns([("", "value", "unit", "known to", "source"), *rows]))
    ends = [f"{end} {'moves' if rig.end_is_free(end) else 'is clamped'}" for end in END_NAMES]
    noisy = [f"{name} ({sensor.noise:g})" for name, sensor in rig.sensors.items() if sensor.noise > 0.0]
    free = list_names(rig.free()) if rig.free() else "nothing: every value is fixed"
    said = list_names(noisy) if noisy else "no channel; it is estimated from each record"
    _terminal.say(f"ends: {list_names(ends)}", indent=2)
    _terminal.say(f"identify fits: {free}", indent=2)
    _terminal.say(f"noise stated for: {said}", indent=2)
    if old := [f"{n} ({1e3 * sensor.delay:g} ms)" for n, sensor in rig.sensors.items() if sensor.delay]:
        _terminal.say(f"read late: {list_names(old)}", indent=2)
    if filtered := [f"{n} ({known.kind})" for n, known in rig.filters().items()]:
        _terminal.say(f"read behind a filter: {list_names(filtered)}", indent=2)
    if not rig.free():
        _terminal.say("give a value a spread (0.3: known to 30 %) if identify should estimate it", indent=2)
    return 0


def _row(rig: Rig, name: str) -> tuple[str, ...]:
    doubt = f"+-{100.0 * rig.spread(name):g} %" if name in rig.free() else "fixed"
    return name, f"{rig[name]:.6g}", plain(rig.unit(name)), doubt, rig.quantities[name].source


