"""`rsea simulate`: a synthetic bag, with any effect of the catalogue switched on."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from msg_adapters import write_record
from rsea_ros.cli._output import add_force
from rsea_ros.cli._terminal import say, whole_number
from rsea_ros.cli._topics import add_topic_options, topic_map
from rsea_ros.documents.strict_yaml import is_decimal
from rsea_ros.documents.wording import quote
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.errors import ParameterError
from rsea_ros.identification.excitation import JOINT, KINDS, ExcitationSettings, check_limits, excitation
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_document import check_effects
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.outputs.new_files import check_free
from rsea_ros.records.record import Channel

HELP = "simulate a rig and write a bag, with any effect of the catalogue switched on"
EXAMPLE = "rsea simulate paper_high_impedance --effect backlash:gap=0.004 --out worn"


_MOST_TORQUE, _MOST_TURNED = 100.0, 3.2
"""N m, rad. Larger commands are refused unless --limit allows them."""


def _default(name: str) -> str:
    return f"(default {getattr(ExcitationSettings(), name):g}, for a position loop {getattr(JOINT, name):g})"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments."""
    parser.add_argument("rig", help="rig or model.yaml, or the name of one in config/rigs")
    parser.add_argument("--out", required=True, help="bag to write: a directory, or a file .mcap or .db3")
    add_force(parser)
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="NAME:param=value,…",
        help="switch an effect on, SI units; without parameters its typical size. Effects: "
        + ", ".join(catalogue()),
    )
    default = ExcitationSettings()
    parser.add_argument(
        "--excitation",
        default="chirp",
        choices=sorted(KINDS),
        help="kind of the command (default %(default)s)",
    )
    parser.add_argument("--duration", type=float, default=60.0, help="duration, s (default %(default)s)")
    parser.add_argument("--rate", type=float, help=f"rate of the commands, Hz {_default('rate')}")
    parser.add_argument(
        "--amplitude", type=float, help=f"amplitude, N·m, for a position loop rad {_default('amplitude')}"
    )
    parser.add_argument(
        "--deviation",
        type=float,
        help=f"standard deviation of noise on a chirp, N·m, for a position loop rad {_default('noise')}",
    )
    parser.add_argument("--low", type=float, help=f"lowest frequency, Hz {_default('low')}")
    parser.add_argument("--high", type=float, help=f"highest frequency, Hz {_default('high')}")
    parser.add_argument(
        "--period",
        type=float,
        default=default.period,
        help="period of multisine and steps, s (default %(default)s)",
    )
    add = parser.add_argument
    add("--limit", type=float, help="largest command allowed (default 100 N·m, for a position loop 3.2 rad)")
    parser.add_argument(
        "--seed", type=whole_number, default=0, help="seed of command and sensor noise (default %(default)s)"
    )
    parser.add_argument("--no-noise", action="store_true", help="simulate perfect sensors")
    add_topic_options(parser)


def run(args: argparse.Namespace) -> int:
    """Simulate and write the bag."""
    check_free([Path(args.out)], force=args.force, inputs=[args.rig])
    rig = load_rig(args.rig)
    rig = rig.with_effects(*rig.effects, *(parse_effect(text) for text in args.effect))
    check_effects(rig.effects)
    settings = _settings(args, JOINT if rig.loop else ExcitationSettings())
    values = excitation(args.excitation, settings)
    limit, unit = (_MOST_TURNED, "rad") if rig.loop else (_MOST_TORQUE, "N m")
    check_limits(values, limit if args.limit is None else args.limit, settings.rate, unit)
    command = Channel(np.arange(len(values)) / settings.rate, values)
    record = synthesize(rig, command, seed=args.seed + 1, noise=not args.no_noise)
    write_record(record, args.out, topic_map(args), force=args.force)
    print(
        f"{args.out}: {args.duration:g} s at {settings.rate:g} Hz of {rig.name}"
        + "".join(f", {e.name}" for e in rig.effects)
    )
    if args.high is not None and settings.top < args.high:
        half = settings.rate / 2.0
        say(f"excited up to {settings.top:g} Hz, not {args.high:g} Hz: half the rate is {half:g} Hz")
    return 0


def _settings(args: argparse.Namespace, default: ExcitationSettings) -> ExcitationSettings:
    """Return the excitation of the options, with the defaults of this kind of rig."""
    options = {
        "rate": args.rate,
        "amplitude": args.amplitude,
        "noise": args.deviation,
        "low": args.low,
        "high": args.high,
    }
    given = {name: value for name, value in options.items() if value is not None}
    return replace(default, duration=args.duration, period=args.period, seed=args.seed, **given)


def parse_effect(text: str) -> EffectSetting:
    """Return the setting of `NAME:param=value,…`. Raises ParameterError for any other form."""
    name, _, rest = text.partition(":")
    effect = effect_named(name)
    values: dict[str, float] = {}
    cut = quote(text)[1:-1]
    for item in filter(None, rest.split(",")):
        key, _, value = (part.strip() for part in item.partition("="))
        if not is_decimal(value):
            bounds = "".join(f" ({p.name}: {p.bounds})" for p in effect.parameters if p.name == key)
            expected = f"expected NAME:param=value with a number in SI{bounds}"
            raise ParameterError(f"--effect {cut}: {key[:40]} = {quote(value)}, {expected}")
        if key in values:
            raise ParameterError(f"--effect {cut}: {key} is given twice, expected once")
        values[key] = float(value)
    complete = effect.typical | values
    effect.check(complete)
    return EffectSetting(name, complete)
