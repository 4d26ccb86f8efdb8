"""`rsea topics`: show the published topics without `ros2 topic`."""

import argparse

from rsea_ros.cli._processes import need_ros
from rsea_ros.cli._terminal import columns, positive, whole_number

HELP = "show the published topics: list, rate of a topic, its messages (echo)"
EXAMPLE = "rsea topics rate /rsea/ft"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", metavar="list|rate|echo")
    listing = actions.add_parser("list", help="list every topic with type and publishers (the default)")
    rate = actions.add_parser("rate", help="print the rate of a topic, and the longest gap")
    echo = actions.add_parser("echo", help="print messages as text")
    for action in (rate, echo):
        action.add_argument("topic", help="name of the topic, /rsea/ft or ft")
    for action, usual in ((parser, 1.0), (listing, 1.0), (rate, 3.0)):
        about = "time to listen, s (default %(default)s)"
        action.add_argument("--seconds", type=positive, default=usual, help=about)
    about = "number of messages to show (default %(default)s)"
    echo.add_argument("--count", type=whole_number, default=1, help=about)
    about = "longest time to wait, s (default %(default)s)"
    echo.add_argument("--seconds", type=positive, default=10.0, help=about)


def run(args: argparse.Namespace) -> int:
    need_ros()
    from rsea_ros.nodes._visitor import Listener, visit

    with visit("rsea_topics") as node:
        listener = Listener(node)
        if args.action == "rate":
            print(listener.rate(args.topic, args.seconds))
        elif args.action == "echo":
            for text in listener.messages(args.topic, args.count, args.seconds):
                print(text, end="---\n", flush=True)
        else:
            rows = listener.topics(args.seconds)
            print(columns([("topic", "type", "publishers", "subscribers"), *rows]) if rows else "no topic")
    return 0
