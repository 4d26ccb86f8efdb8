"""Actions of a verb: `rsea fleet run`, `rsea benchmark make`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import NamedTuple


class Action(NamedTuple):
    """What a verb can do. help: one line. add: declares its arguments. run: returns the exit status."""

    help: str
    add: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def add_actions(parser: argparse.ArgumentParser, actions: Mapping[str, Action]) -> None:
    """Declare the actions of a verb; the chosen one becomes `args.action`."""
    added = parser.add_subparsers(dest="action", required=True, metavar="|".join(actions))
    for name, action in actions.items():
        action.add(added.add_parser(name, help=action.help, description=action.help))
