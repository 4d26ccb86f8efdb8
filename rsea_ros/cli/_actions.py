"""Actions of a verb: `rsea VERB ACTION …`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from typing import NamedTuple


class Action(NamedTuple):
    """An action of a verb."""

    help: str
    add: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


def add_actions(parser: argparse.ArgumentParser, actions: Mapping[str, Action]) -> None:
    """Declare the actions; the chosen name is `args.action`."""
    parsers = parser.add_subparsers(dest="action", required=True, metavar="|".join(actions))
    for name, action in actions.items():
        action.add(parsers.add_parser(name, help=action.help, description=action.help))
