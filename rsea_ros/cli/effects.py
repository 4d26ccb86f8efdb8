"""`rsea effects`: the catalogue of effects."""

import argparse

from rsea_ros import effects
from rsea_ros.cli._terminal import say
from rsea_ros.effects.catalogue import EffectPage, effect_named
from rsea_ros.effects.parameter import MACHINE

HELP = "list the effects that a diagnosis can name: equation, parameters, units, typical sizes, source"
EXAMPLE = "rsea effects backlash"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    about = "the effect to show in full (default: one line for each effect)"
    parser.add_argument("name", nargs="?", help=about)


def run(args: argparse.Namespace) -> int:
    if args.name is None:
        for line in repr(effects).splitlines():
            say(line, indent=4)
        print()
        say("rsea effects NAME shows equation, parameters and source.")
        return 0
    page = EffectPage(effect_named(args.name))
    for line in str(page).splitlines():
        say(line, indent=len(line) - len(line.lstrip()) + 2)
    print()
    for paragraph in page.description.split("\n\n"):
        lines = paragraph.strip("\n").splitlines()
        has_equation = any(line.startswith(" ") for line in lines)
        for line in lines if has_equation else [" ".join(lines)]:
            say(line)
        print()
    say(f"Bounds and sizes are for {MACHINE}; on others they grow as named, in powers of four.")
    return 0
