"""Arguments of every verb that reads recorded runs: the bags, and the rig that they are of."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from typing import Any

from rsea_ros.cli._topics import topic_options, window_options
from rsea_ros.identification.result import Remark
from rsea_ros.model.rig_file import RigChoice

RIG = "paper_high_impedance"
"""The rig of a verb that is not given one."""
OFF_RIG = "off_rig"
"""Finding of --fail-on: a fitted value is far from the rig's."""
_RIGS = "rig file, or the name of one in config/rigs"


def add_runs(parser: argparse.ArgumentParser, several: str = "") -> None:
    """Declare the bags. several: what more than one of them are."""
    about = f"rosbag2 directory, .mcap or .db3{f'; {several}' if several else ''}"
    parser.add_argument("bags", nargs="+", metavar="BAG", help=about)


def add_rig(parser: argparse.ArgumentParser, about: str = _RIGS) -> None:
    """Declare --rig."""
    parser.set_defaults(rig_is_default=True)
    parser.add_argument("--rig", default=RIG, action=_Given, help=f"{about} (default %(default)s)")


def rig_choice(args: argparse.Namespace) -> RigChoice:
    """Return how the rig and the data of a verb with --rig were chosen."""
    return RigChoice(args.rig, args.rig_is_default, topic_options(args), window_options(args))


def off_rig(remarks: Iterable[Remark]) -> list[str]:
    """Return the finding that a value is far from the rig's, if one is."""
    return [OFF_RIG] if any(r.code == OFF_RIG for r in remarks) else []


class _Given(argparse.Action):
    """Stores the rig, and that it is not the default."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[Any] | None,
        option_string: str | None = None,
    ) -> None:
        namespace.rig, namespace.rig_is_default = values, False
