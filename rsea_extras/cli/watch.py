"""`rsea watch`: the live view in a browser."""

import argparse
from pathlib import Path

from rsea_ros.extension.verb import RIG, become, need_ros, parameter_words, path, positive

HELP = "show torques, deflection, flag and health live in a browser; record, identify and diagnose there"
EXAMPLE = "rsea watch --rig paper_high_impedance --host 0.0.0.0"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--rig", default=RIG, help="rig of the bench: a name in config/rigs, or a file")
    add("--host", default="localhost", help="address of the server; 0.0.0.0: also for the network (a phone)")
    add("--port", type=int, default=8270, help="port of the page; 0: any free port (default %(default)s)")
    add("--command", action="store_true", help="allow a page to command torque within the driver's limits")
    add("--limit", type=positive, default=10.0,
        help="largest torque that a page may command, N·m (default %(default)s); a smaller limit of the"
        " driver prevails")
    add("--rate", type=positive, default=280.0,
        help="rate at which a page commands, Hz; use that of the bench (default %(default)s)")
    add("--out", type=path, default=Path("runs"), help="folder of the recordings (default %(default)s)")
    add("--namespace", default="rsea", help="namespace of the topics (default %(default)s)")
    add("--joint", default="joint", help="name of the joint (default %(default)s)")
    add("--axis", default="torque.z", help="actuator axis of the wrench on ft (default %(default)s)")


def run(args: argparse.Namespace) -> int:
    """Become the node's process."""
    need_ros()
    names = ("rig", "host", "port", "command", "limit", "rate", "out", "joint", "axis")
    given = {name: getattr(args, name) for name in names}
    namespace = f"__ns:=/{args.namespace.strip('/')}"
    become(["-m", "rsea_extras.watch.node", "--ros-args", "-r", namespace, *parameter_words(given)])
