"""`rsea launch`: start a graph of nodes without `ros2 launch`."""

import argparse

from rsea_ros.cli._processes import arguments_of_graphs, graph_names, need_ros, node_calls, together

HELP = "start a graph of nodes: simulation, hardware or replay; Ctrl-C stops them all"
EXAMPLE = "rsea launch simulation rig:=paper_moving_output excite:=true record:=true"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("graph", metavar="GRAPH", help=", ".join(graph_names()))
    rows = "\n".join(
        f"  {name:<11} {about} (default {default or 'none'})"
        for name, (default, about) in arguments_of_graphs().items()
    )
    parser.add_argument("arguments", nargs="*", metavar="NAME:=VALUE", help="see below")
    parser.epilog = f"arguments:\n{rows}\n\n{parser.epilog}"


def run(args: argparse.Namespace) -> int:
    """Start the nodes and wait until they have ended; return the worst of their statuses."""
    need_ros()
    return together({call.name: call.arguments for call in node_calls(args.graph, args.arguments)})
