"""`rsea export`: a rig as a model of another program, and the parts that it cannot express."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsea_ros.cli._lines import say
from rsea_ros.cli._numbers import positive
from rsea_ros.cli._output import FOUND, add_force, path
from rsea_ros.new_files import check_free, write_file

if TYPE_CHECKING:
    from rsea_ros.exports.difference import Difference
    from rsea_ros.exports.represented import Export
    from rsea_ros.model.rig import Rig

HELP = "convert a rig to MuJoCo, FMI, URDF, SDF, Isaac Lab or BAM, and list the parts left out"
EXAMPLE = "rsea export --mjcf paper_high_impedance --out bench.xml"
TARGETS = {
    "mjcf": "MJCF for MuJoCo 4",
    "urdf": "URDF, with a block of all values",
    "sdf": "SDF 1.11, with a block of all values",
    "fmu": "FMU for co-simulation, FMI 3",
    "isaac": "actuator of Isaac Lab, a Python file",
    "bam": "parameters of BAM (M1 to M6), JSON",
}
DURATION = 2.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    targets = parser.add_mutually_exclusive_group(required=True)
    for name, about in TARGETS.items():
        aliases = ["--rig"] if name == "mjcf" else []
        about = f"rig, model.yaml or name of a rig: {about}"
        targets.add_argument(f"--{name}", *aliases, dest=name, metavar="RIG", help=about)
    add = parser.add_argument
    add("--out", type=path, help="file to be written (default the rig's name)")
    add_force(parser)
    effect = "switch an effect on, SI units"
    add("--effect", action="append", default=[], metavar="NAME:param=value,…", help=effect)
    add("--actuator", default="", metavar="NAME", help="for --bam: name of the servo in BAM, such as mx106")
    add("--no-play", action="store_true", help="write the file without verifying it")
    played = "duration of the chirp that verifies --mjcf and --fmu, s"
    add("--duration", type=positive, default=DURATION, help=f"{played} (default %(default)s)")
    add("--amplitude", type=positive, help="its amplitude, N·m, position loop: rad (default 10, 0.4)")
    limit = "exit status 1 if a channel differs by more than TIMES times its noise"
    add("--limit", type=positive, metavar="TIMES", help=limit)
    add("--json", action="store_true", help="print content, omissions and differences as JSON")


def run(args: argparse.Namespace) -> int:
    """Export, verify, write, and report."""
    from rsea_ros.cli.simulate import parse_effect
    from rsea_ros.model.effect_settings import check_effects
    from rsea_ros.model.rig_file import load_rig

    target = next(name for name in TARGETS if getattr(args, name))
    source = getattr(args, target)
    rig = load_rig(source)
    rig = rig.with_effects(*rig.effects, *(parse_effect(text) for text in args.effect))
    check_effects(rig.effects)
    suffix = {"mjcf": ".xml", "isaac": ".py", "bam": ".json"}.get(target, f".{target}")
    out = args.out or Path(f"{rig.name}{suffix}")
    check_free([out], force=args.force, inputs=[source])
    made = _exporters(args)[target](rig)
    difference, not_played = _play(made, rig, args)
    write_file(out, made.content, force=args.force)
    if args.json:
        print(json.dumps(_document(made, rig, out, difference, not_played), indent=2))
    else:
        for line in _lines(made, rig, out, difference, not_played):
            say(line, indent=4)
    too_far = args.limit is not None and any(not one.times_noise <= args.limit for one in difference)
    return FOUND if too_far else 0


def _exporters(args: argparse.Namespace) -> Mapping[str, Callable[[Rig], Export]]:
    from rsea_ros.exports.bam import export_bam
    from rsea_ros.exports.fmu import export_fmu
    from rsea_ros.exports.isaac import export_isaac
    from rsea_ros.exports.mjcf import export_mjcf
    from rsea_ros.exports.sdf import export_sdf
    from rsea_ros.exports.urdf import export_urdf

    def bam(rig: Rig) -> Export:
        return export_bam(rig, args.actuator)

    return {
        "mjcf": export_mjcf, "urdf": export_urdf, "sdf": export_sdf, "fmu": export_fmu, "isaac": export_isaac,
        "bam": bam,
    }  # fmt: skip


def _play(made: Export, rig: Rig, args: argparse.Namespace) -> tuple[tuple[Difference, ...], str]:
    """Return the differences to our simulation, and the reason if there are none.

    Raises ParameterError if --limit needs them and they are not available.
    """
    from rsea_ros.errors import ParameterError
    from rsea_ros.exports.difference import RATE, differences, ours
    from rsea_ros.exports.fmu_play import play_fmu
    from rsea_ros.exports.mujoco_play import play_mujoco

    players: Mapping[str, Callable[..., Any]] = {"mjcf": play_mujoco, "fmu": play_fmu}
    why = "--no-play" if args.no_play else ""
    if made.target not in players:
        why = "only --mjcf and --fmu are verified by simulation"
    if not why:
        command = _excitation(rig, args, RATE)
        try:
            theirs = players[made.target](made.content, rig, command)
            difference = differences(rig, ours(rig, command, RATE), theirs)
            why = "" if difference else "the rig states no sensor noise, expected sensors.ft.noise or another"
        except ParameterError as error:
            difference, why = (), str(error)
        if difference:
            return difference, ""
    if args.limit is not None:
        raise ParameterError(f"--limit {args.limit:g}: not played: {why}")
    return (), why


def _excitation(rig: Rig, args: argparse.Namespace, rate: float) -> Any:
    """Return the chirp that verifies the export, N m or rad."""
    from dataclasses import replace

    from rsea_ros.identification.excitation import JOINT, ExcitationSettings, excitation

    default = JOINT if rig.loop else ExcitationSettings(amplitude=10.0, noise=2.0, high=60.0)
    size = args.amplitude or default.amplitude
    noise = default.noise * size / default.amplitude
    low = max(0.5, 1.0 / args.duration)
    settings = replace(default, rate=rate, duration=args.duration, low=low, amplitude=size, noise=noise)
    return excitation("chirp", settings)


def _lines(
    made: Export, rig: Rig, out: Path, differences: tuple[Difference, ...], not_played: str
) -> list[str]:
    """Return the report as text: file, content, omissions, differences."""
    from rsea_ros.exports.represented import coverage_lines
    from rsea_ros.units import plain

    lines = [f"{out}: {TARGETS[made.target]}, of {rig.name}"]
    lines += [f"  {line}" for line in coverage_lines(made.represented, made.omitted)]
    lines += [
        f"played in both: {one.channel} differs by {one.times_noise:.3g} times the sensor's noise "
        f"({one.rms:.3g} {plain(one.unit)} of {one.signal:.3g})"
        for one in differences
    ]
    return [*lines, f"not played: {not_played}"] if not_played else lines


def _document(
    made: Export, rig: Rig, out: Path, differences: tuple[Difference, ...], not_played: str
) -> dict[str, Any]:
    return {
        "schema": 1,
        "rig": rig.name,
        "target": made.target,
        "file": str(out),
        "says": {one.name: one.how for one in made.represented},
        "leaves_out": {one.name: one.why for one in made.omitted},
        "not_played": not_played or None,
        "difference": {
            one.channel: {
                "times_noise": one.times_noise, "rms": one.rms, "signal": one.signal, "noise": one.noise,
                "unit": one.unit,
            }
            for one in differences
        },
    }  # fmt: skip
