"""`rsea call`: call a running node without `ros2 service` and `ros2 lifecycle`."""

import argparse

from rsea_ros.cli._processes import need_ros
from rsea_ros.cli._terminal import columns, positive

HELP = "call a running node: activate, deactivate, clear_fault, stop …"
EXAMPLE = "rsea call driver configure activate"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("node", nargs="?", default="", help="node: driver or /rsea/driver; without it, all are listed")
    add("action", nargs="*", help="actions, in this order; without one, those that it offers are listed")
    add("--seconds", type=positive, default=1.0, help="time to look for nodes, s (default %(default)s)")


def run(args: argparse.Namespace) -> int:
    need_ros()
    from rsea_ros.nodes._visitor import Caller, visit

    with visit("rsea_call") as node:
        caller = Caller(node)
        for action in args.action:
            print(caller.call(args.node, action), flush=True)
        if not args.action:
            name = args.node
            nodes = [caller.full_name(name)] if name else caller.callable_nodes(args.seconds)
            rows = [(each, *caller.offer(each)) for each in nodes]
            print(columns([("node", "state", "actions"), *rows]) if rows else "no node that can be called")
    return 0
