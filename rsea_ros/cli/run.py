"""`rsea run`: start a node without `ros2 run`."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from rsea_ros.cli._processes import need_ros
from rsea_ros.documents.wording import did_you_mean
from rsea_ros.errors import ParameterError
from rsea_ros.plugins import node_modules

HELP = "start a node, as `ros2 run rsea_ros NODE` does, or your own program"
EXAMPLE = "rsea run plant rig:=pendulum rate:=500.0"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the verb's arguments; unknown ones go to the node."""
    parser.add_argument("node", metavar="NODE", help=f"{', '.join(node_modules())}, or your own .py file")
    about = "parameters of the node (rsea run NODE --params lists them)"
    parser.add_argument("parameters", nargs="*", metavar="NAME:=VALUE", help=about)
    about = "show the parameters of the node with unit and range"
    parser.add_argument("--params", action="store_true", help=about)
    parser.set_defaults(pass_on=[])


def run(args: argparse.Namespace) -> int:
    """Become the node's process."""
    need_ros()
    nodes = node_modules()
    kinds = [word for word in args.parameters if args.node == "joint" and ":=" not in word]
    given = ros_arguments([word for word in args.parameters if word not in kinds])
    words = [*kinds, *(["--help"] if args.params else []), *given, *args.pass_on]
    if args.node.endswith(".py"):
        if not Path(args.node).is_file():
            raise ParameterError(f"{args.node}: no such file, expected a Python program or a node")
        become([args.node, *words])
    if args.node not in nodes:
        near = did_you_mean(args.node, nodes)
        raise ParameterError(f"node {args.node!r}, expected one of {', '.join(nodes)}{near}")
    become(["-m", nodes[args.node], *words])


def become(words: Sequence[str]) -> NoReturn:
    """Replace this process by Python with these arguments, so that signals reach the node itself."""
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, *words])


def ros_arguments(parameters: list[str]) -> list[str]:
    """Return parameters as ROS arguments. Raises ParameterError for a word that is not an assignment."""
    for word in parameters:
        if ":=" not in word:
            raise ParameterError(f"parameter {word!r}, expected NAME:=VALUE")
    return ["--ros-args", *(part for word in parameters for part in ("-p", word)), "--"] if parameters else []
