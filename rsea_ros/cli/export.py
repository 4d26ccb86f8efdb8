"""`rsea export`: a rig as a model of another program, and the parts that it cannot express."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsea_ros.cli._options import FOUND, add_force, path, provenance
from rsea_ros.cli._terminal import positive, say
from rsea_ros.documents.strict_yaml import load
from rsea_ros.documents.units import plain
from rsea_ros.errors import FieldError, ParameterError, RigError
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_document import check_effects
from rsea_ros.model.rig_file import load_rig
from rsea_ros.outputs.files import Destination, NewFiles, check_free, write_file
from rsea_ros.plugins import TARGETS, installed, not_installed, registered
from rsea_ros.records.record import FloatArray
from rsea_ros.report.result_files import DIAGNOSIS_JSON, MODEL, pick

if TYPE_CHECKING:
    from rsea_ros.exports.others import Export
    from rsea_ros.exports.verification import Difference, Verification

HELP = "convert a rig to MuJoCo, FMI, URDF, SDF, Isaac Lab, BAM or C; list the parts left out"
EXAMPLE = "rsea export --mjcf paper_high_impedance --out bench.xml"
ABOUT = {
    "mjcf": "MJCF for MuJoCo 4",
    "urdf": "URDF, with a block of all values",
    "sdf": "SDF 1.11, with a block of all values",
    "fmu": "FMU for co-simulation, FMI 3",
    "isaac": "actuator of Isaac Lab, a Python file",
    "bam": "parameters of BAM (M1 to M6), JSON",
    "feedforward": "friction, ripple and gravity for your controller: C, Python, table",
}
DURATION = 2.0
_NUMBERS = "times_noise rms signal noise unit"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    targets = parser.add_mutually_exclusive_group(required=True)
    for name, about in abouts().items():
        aliases = ["--rig"] if name == "mjcf" else []
        about = f"rig, model.yaml or name of a rig: {about}"
        targets.add_argument(f"--{name}", *aliases, dest=name, metavar="RIG", help=about)
    add = parser.add_argument
    add("--out", type=path, help="file to be written, or folder of a feed-forward (default the rig's name)")
    add_force(parser)
    effect = "switch an effect on, SI units"
    add("--effect", action="append", default=[], metavar="NAME:param=value,…", help=effect)
    add("--actuator", default="", metavar="NAME", help="for --bam: name of the servo in BAM, such as mx106")
    add("--no-play", action="store_true", help="write the file without verifying it")
    played = "duration of the chirp that verifies the export, s"
    add("--duration", type=positive, default=DURATION, help=f"{played} (default %(default)s)")
    add("--amplitude", type=positive, help="its amplitude, N·m, position loop: rad (default 10, 0.4)")
    limit = "exit status 1 if a channel differs by more than TIMES times its noise"
    add("--limit", type=positive, metavar="TIMES", help=limit)
    add("--json", action="store_true", help="print content, omissions and differences as JSON")


def run(args: argparse.Namespace) -> int:
    from rsea_ros.cli.simulate import parse_effect

    target = next(name for name in abouts() if getattr(args, name) is not None)
    source = getattr(args, target)
    rig = load_rig(source)
    rig = rig.with_effects(*rig.effects, *(parse_effect(text) for text in args.effect))
    check_effects(rig.effects)
    made = _export(target, rig, args)
    out = args.out or Path(f"{rig.name}{made.suffix}")
    files = [out / name for name in made.content] if isinstance(made.content, Mapping) else [out]
    check_free(files, force=args.force, inputs=[source])
    verified = _verification(made, rig, args)
    if isinstance(made.content, Mapping):
        with NewFiles(Destination(out, args.force)) as new:
            for name, text in made.content.items():
                new.write(name, text)
    else:
        write_file(out, made.content, force=args.force)
    if args.json:
        print(json.dumps(_document(made, rig, out, verified), indent=2))
    else:
        for line in _lines(made, rig, out, verified):
            say(line, indent=4)
    if args.limit is None or all(one.times_noise <= args.limit for one in verified.differences):
        return 0
    return FOUND


def _export(target: str, rig: Rig, args: argparse.Namespace) -> Export:
    """Return a rig for a target, by the function that is registered for it."""
    options: dict[str, Any] = {}
    if target == "bam":
        options = {"actuator": args.actuator}
    elif target == "feedforward":
        options = _measured(args.feedforward, rig) | {"suffix": args.out.suffix if args.out else ""}
    made: Export = exporter(target)(rig, **options)
    return made


def abouts() -> dict[str, str]:
    """Return what each target is, by name; those that other packages register included."""
    return ABOUT | {n: f"target of {at}" for n, at in installed(TARGETS).items() if n not in ABOUT}


def exporter(target: str) -> Callable[..., Any]:
    """Return the function that makes a target of a rig. Raises ParameterError where it is not installed."""
    place = "rsea_ros.exports.mjcf:export_mjcf" if target == "mjcf" else registered(TARGETS, target)
    if not place:
        raise not_installed(f"--{target}")
    module, _, name = place.partition(":")
    function: Callable[..., Any] = getattr(import_module(module), name)
    return function


def _measured(source: str, rig: Rig) -> dict[str, Any]:
    """Return where a rig's values come from; of a diagnosis beside its model: date, residuals, intervals.

    Intervals are those of values that nobody has changed since. Raises RigError for an unreadable diagnosis.
    """
    lines = [*provenance("export", [], source).lines]
    values = rig.values() | {f"{e.name}.{p}": v for e in rig.effects for p, v in e.parameters.items()}

    def intervals(found: Any) -> dict[str, tuple[float, float]]:
        try:
            sizes, origin = dict(found["extended"]["parameters"]), found.get("provenance", {})
            for cause in found["causes"]:
                sizes |= {f"{cause['name']}.{name}": size for name, size in cause["parameters"].items()}
            rms = ", ".join(f"{name} {v:.3g}" for name, v in found["extended"]["residual_rms"].items())
            lines.append(f"diagnosed by {origin.get('version')}, {origin.get('date')}: {found['sentence']}")
            lines.append(f"residual, RMS, SI: {rms}")
            known = {name: (size["value"], *(size["ci95"] or [None])) for name, size in sizes.items()}
            finite = {name: size for name, size in known.items() if name in values and None not in size}
            same = {name: ends for name, (v, *ends) in finite.items() if math.isclose(v, values[name])}
            return {name: (float(low), float(high)) for name, (low, high) in same.items()}
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise FieldError(f"{error!r}, expected the diagnosis of the model beside it") from None

    beside = Path(source).parent / DIAGNOSIS_JSON
    if Path(source).name != MODEL or not beside.is_file():
        return {"measured": lines}
    known = load(beside, "the diagnosis of the model beside it", RigError, intervals)
    return {"measured": lines, "intervals": known}


def _verification(made: Export, rig: Rig, args: argparse.Namespace) -> Verification:
    """Return the verification. Raises ParameterError if --limit needs a play and there is none."""
    from rsea_ros.exports.verification import Verification, verify

    verified = Verification(not_played="--no-play")
    if not args.no_play:
        verified = verify(made, rig, _chirp(rig, args))
    if args.limit is not None and verified.not_played:
        raise ParameterError(f"--limit {args.limit:g}: not played: {verified.not_played}")
    return verified


def _chirp(rig: Rig, args: argparse.Namespace) -> FloatArray:
    from rsea_ros.exports.verification import RATE
    from rsea_ros.identification.excitation import JOINT, ExcitationSettings, excitation

    default = JOINT if rig.loop else ExcitationSettings(amplitude=10.0, noise=2.0, high=60.0)
    size = args.amplitude or default.amplitude
    noise = default.noise * size / default.amplitude
    low = max(0.5, 1.0 / args.duration)
    settings = replace(default, rate=RATE, duration=args.duration, low=low, amplitude=size, noise=noise)
    return excitation("chirp", settings)


def _lines(made: Export, rig: Rig, out: Path, verified: Verification) -> list[str]:
    """Return the report as text: file, content, omissions and what they cost, differences."""
    from rsea_ros.exports.others import coverage_lines

    lines = [f"{out}: {ABOUT.get(made.target, made.target)}, of {rig.name}"]
    lines += [f"  {line}" for line in coverage_lines(made.says, made.leaves_out)]
    lines += [f"  without {name}: {_apart(one)}" for name, one in verified.losses.items()]
    lines += [f"played in both: {_apart(one)}" for one in verified.differences]
    return [*lines, f"not played: {verified.not_played}"] if verified.not_played else lines


def _apart(one: Difference) -> str:
    return (
        f"{one.channel} differs by {one.times_noise:.3g} times the sensor's noise "
        f"({one.rms:.3g} {plain(one.unit)} of {one.signal:.3g})"
    )


def _document(made: Export, rig: Rig, out: Path, verified: Verification) -> dict[str, Any]:
    return {
        "schema": 1,
        "rig": rig.name,
        "target": made.target,
        "file": str(out),
        "says": made.says,
        "leaves_out": made.leaves_out,
        "loss": {name: pick(one, f"channel {_NUMBERS}") for name, one in verified.losses.items()},
        "not_played": verified.not_played or None,
        "difference": {one.channel: pick(one, _NUMBERS) for one in verified.differences},
    }
