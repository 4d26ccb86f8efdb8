"""joint: several nodes of one joint in one process and one executor, in yours with `compose`.

They share the libraries and the middleware's participant, and the interpreter's lock: one that computes makes
the others late.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.executors import Executor
from rclpy.parameter import Parameter

from rsea_ros.documents.wording import did_you_mean
from rsea_ros.errors import ParameterError
from rsea_ros.nodes._health import STEADY
from rsea_ros.nodes._run import BAD_INPUT, NAMESPACE, TICK, Component, Member, own_arguments, run_nodes
from rsea_ros.plugins import node_modules

USUAL = ("driver", "controller", "model")
KINDS = {name: module for name, module in node_modules().items() if name != "joint"}
"""By name of its executable: the module of each other node."""


def component(kind: str) -> Component:
    """Return a kind of node by the name of its executable. Raises ParameterError where there is none."""
    if kind not in KINDS:
        raise ParameterError(f"node {kind!r}, expected one of {', '.join(KINDS)}{did_you_mean(kind, KINDS)}")
    found: Component = importlib.import_module(KINDS[kind]).NODE
    return found


def compose(
    kind: str, executor: Executor, parameters: Mapping[str, Any] | None = None, *, name: str = "",
    namespace: str = NAMESPACE, arguments: Sequence[str] = (),
) -> Member:  # fmt: skip
    """Make a node of the package in your process and executor; `close` ends it, a driver at zero torque.

    kind: name of its executable. parameters: by name. name: of the node, as that of its kind if empty.
    arguments: as of a command line, such as ["--ros-args", "-r", "ft:=other"]; those of your process are not
    used. An error in its thread is raised where you spin. Raises RseaError for what it cannot be made with.
    """
    given = [Parameter(key, value=value) for key, value in (parameters or {}).items()]
    member = Member(
        component(kind), executor, name=name, namespace=namespace, parameter_overrides=given,
        cli_args=list(arguments), use_global_arguments=False,
    )  # fmt: skip

    def follow() -> None:
        member.program.is_finished()

    member.node.create_timer(TICK, follow, clock=STEADY)
    return member


def main() -> int:
    """Run the nodes named on the command line, by default those of USUAL."""
    words = own_arguments()
    kinds = [word for word in words if not word.startswith("-")] or USUAL
    try:
        return run_nodes([*map(component, kinds)], [word for word in words if word.startswith("-")])
    except ParameterError as error:
        sys.stderr.write(f"joint: {error}\n")
        return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
