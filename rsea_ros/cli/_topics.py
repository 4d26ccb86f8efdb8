"""Options of every verb that reads or writes a bag: namespace, topic names, joint, axis."""

from __future__ import annotations

import argparse

from msg_adapters.topics import AXES, ROLES, TopicMap
from rsea_ros.errors import ParameterError


def add_topic_options(parser: argparse.ArgumentParser) -> None:
    """Declare --namespace, --topic, --joint and --axis."""
    default = TopicMap()
    group = parser.add_argument_group("bags of another machine")
    group.add_argument("--namespace", default=default.namespace, help="of the topics (default %(default)s)")
    group.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="ROLE=TOPIC",
        help=f"another name; ROLE: {', '.join(ROLES)}",
    )
    group.add_argument("--joint", help="which joint, where the messages hold several")
    axes = ", ".join(AXES)
    group.add_argument(
        "--axis", default=default.axis, help=f"actuator axis of the wrench: {axes}; - in front turns it"
    )


def topic_map(args: argparse.Namespace) -> TopicMap:
    """Return the map that the options ask for. Raises ParameterError for one that makes no sense."""
    for name in (args.namespace, args.joint or "", *args.topic):
        if not name.isprintable():
            raise ParameterError(f"{name!r}: holds what cannot be printed, expected a name of ROS")
    return TopicMap(namespace=args.namespace, joint=args.joint, axis=args.axis).renamed(args.topic)
