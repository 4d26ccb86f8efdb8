"""`rsea simulate`: a synthetic bag, with any effect of the catalogue switched on."""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from msg_adapters import write_record
from rsea_ros.cli._options import add_force, add_topic_options, topic_map
from rsea_ros.cli._terminal import say, whole_number
from rsea_ros.documents.strict_yaml import is_decimal
from rsea_ros.documents.wording import quote
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.errors import ParameterError
from rsea_ros.identification.excitation import JOINT, KINDS, ExcitationSettings, check_limits, excitation
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_document import check_effects
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.outputs.files import check_free
from rsea_ros.records.record import Channel

HELP = "simulate a rig and write a bag, with any effect of the catalogue switched on"
EXAMPLE = "rsea simulate paper_high_impedance --effect backlash:gap=0.004 --out worn"
_MOST_TORQUE, _MOST_TURNED = 100.0, 3.2
"""N m, rad. Larger commands are refused unless --limit allows them."""
_OPTIONS = (
    ("rate", "rate", "rate of the commands, Hz"),
    ("amplitude", "amplitude", "amplitude, N·m, for a position loop rad"),
    ("deviation", "noise", "standard deviation of noise on a chirp, N·m, for a position loop rad"),
    ("low", "low", "lowest frequency, Hz"),
    ("high", "high", "highest frequency, Hz"),
)
"""Option, setting of the excitation, meaning; the defaults are those of the kind of rig."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add, default = parser.add_argument, ExcitationSettings()
    add("rig", help="rig or model.yaml, or the name of one in config/rigs")
    add("--out", required=True, help="bag to write: a directory, or a file .mcap or .db3")
    add_force(parser)
    about = "switch an effect on, SI units; without parameters its typical size. Effects: "
    about += ", ".join(catalogue())
    add("--effect", action="append", default=[], metavar="NAME:param=value,…", help=about)
    kinds = sorted(KINDS)
    add("--excitation", default="chirp", choices=kinds, help="kind of the command (default %(default)s)")
    add("--duration", type=float, default=60.0, help="duration, s (default %(default)s)")
    for name, field, about in _OPTIONS:
        usual = f"(default {getattr(default, field):g}, for a position loop {getattr(JOINT, field):g})"
        add(f"--{name}", type=float, help=f"{about} {usual}")
    about = "period of multisine and steps, s (default %(default)s)"
    add("--period", type=float, default=default.period, help=about)
    add("--limit", type=float, help="largest command allowed (default 100 N·m, for a position loop 3.2 rad)")
    add("--seed", type=whole_number, default=0, help="seed of command and sensor noise (default %(default)s)")
    add("--no-noise", action="store_true", help="simulate perfect sensors")
    add_topic_options(parser)


def run(args: argparse.Namespace) -> int:
    check_free([Path(args.out)], force=args.force, inputs=[args.rig])
    rig = load_rig(args.rig)
    rig = rig.with_effects(*rig.effects, *(parse_effect(text) for text in args.effect))
    check_effects(rig.effects)
    given = {field: value for name, field, _ in _OPTIONS if (value := getattr(args, name)) is not None}
    default = JOINT if rig.loop else ExcitationSettings()
    settings = replace(default, duration=args.duration, period=args.period, seed=args.seed, **given)
    values = excitation(args.excitation, settings)
    limit, unit = (_MOST_TURNED, "rad") if rig.loop else (_MOST_TORQUE, "N m")
    check_limits(values, limit if args.limit is None else args.limit, settings.rate, unit)
    command = Channel(np.arange(len(values)) / settings.rate, values)
    record = synthesize(rig, command, seed=args.seed + 1, noise=not args.no_noise)
    write_record(record, args.out, topic_map(args), force=args.force)
    made = ", ".join([rig.name, *(e.name for e in rig.effects)])
    print(f"{args.out}: {args.duration:g} s at {settings.rate:g} Hz of {made}")
    if args.high is not None and settings.top < args.high:
        half = settings.rate / 2.0
        say(f"excited up to {settings.top:g} Hz, not {args.high:g} Hz: half the rate is {half:g} Hz")
    return 0


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
