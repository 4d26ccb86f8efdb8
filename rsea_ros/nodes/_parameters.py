"""Parameters of a node: a table with description, unit and range; other values are refused."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import SetParametersResult, parameter_descriptor
from msg_adapters.topic_map import AXES
from rsea_ros.documents.units import plain
from rsea_ros.documents.wording import did_you_mean
from rsea_ros.errors import ParameterError, RseaError

Value = bool | int | float | str | list[str]

DERIVED = -1.0
"""Value of a limit's parameter: the limit comes from rig, motor and sensor."""
_ROS_OWN = ("use_sim_time", "start_type_description_service")


@dataclass(frozen=True)
class NodeParameter:
    """One parameter. Its type is the default's; an integer is accepted for a float.

    low, high: inclusive range of a number. choices: allowed texts. whole: of the node, where the others
    may be given for each of several joints. live: may change while the node runs.
    """

    name: str
    default: Value
    description: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: Sequence[str] = ()
    whole: bool = False
    live: bool = False

    def requirement(self) -> str:
        """Return the requirement on a value, in words."""
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        kind = {bool: "true or false", int: "a whole number", float: "a number", str: "a text",
                list: "a list of texts"}[type(self.default)]  # fmt: skip
        bounds = "" if self.low is None else f" from {self.low:g} to {self.high:g}"
        return f"{kind}{bounds}{f' {plain(self.unit)}' if self.unit else ''}"

    def check(self, value: Any) -> Value:
        """Return a value that fits, in the type of the default. Raises ParameterError for any other."""
        if isinstance(self.default, float) and type(value) is int:
            value = float(value)
        if isinstance(self.default, list):
            value = list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value
        if type(value) is not type(self.default) or not self._fits(value):
            raise ParameterError(f"parameter {self.name} = {value!r}, expected {self.requirement()}")
        result: Value = value
        return result

    def _fits(self, value: Value) -> bool:
        if isinstance(value, list):
            return all(isinstance(each, str) for each in value)
        if isinstance(value, str):
            return not self.choices or value in self.choices
        return math.isfinite(value) and (
            self.low is None or self.high is None or self.low <= value <= self.high
        )


AXIS = NodeParameter(
    "axis", "torque.z", "actuator axis of the wrench on ft", choices=(*AXES, *(f"-{a}" for a in AXES))
)
"""Of every node that listens to ft."""
JOINT = NodeParameter(
    "joint", "joint", "name of the joint in commands and states; another one is refused", whole=True
)
"""Of every node that commands or measures it."""


def stated_limits(values: Mapping[str, Any], names: Sequence[str]) -> dict[str, float]:
    """Return the limits that are not derived, inf for none. Raises ParameterError for a negative one."""
    stated = {}
    for name in names:
        value = values[f"{name}_limit"]
        if value == DERIVED:
            continue
        if value < 0.0:
            expected = f"expected {DERIVED:g} to derive it, or at least 0"
            raise ParameterError(f"parameter {name}_limit = {value:g}, {expected}")
        stated[name] = value if value or name == "torque" else math.inf
    return stated


def declare(
    node: Node,
    table: Sequence[NodeParameter],
    more: Callable[[Mapping[str, Any]], Sequence[NodeParameter]] = lambda given: (),
    foreign: Collection[str] = (),
) -> dict[str, Any]:
    """Declare a table on a node and return the values. more: further parameters, from the given ones.

    foreign: names that are given to all nodes of the process, and are none of this one's.
    The node was made with `automatically_declare_parameters_from_overrides`, so it has the given values.
    Raises ParameterError for a wrong value, and for a name that is not in the table.
    """
    given = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
    table = [*table, *more(given)]
    for name in given.keys() & (set(foreign) - {p.name for p in table}):
        node.undeclare_parameter(name)
        del given[name]
    _refuse_unknown(given, table)
    values = {p.name: p.check(given.get(p.name, p.default)) for p in table}
    for parameter in table:
        if parameter.name in given:
            node.undeclare_parameter(parameter.name)
        node.declare_parameter(
            parameter.name, values[parameter.name], _descriptor(parameter), ignore_override=True
        )
    return values


def _refuse_unknown(given: Mapping[str, Any], table: Sequence[NodeParameter]) -> None:
    names = [p.name for p in table]
    for name in given:
        if name not in names and name not in _ROS_OWN and not name.startswith("qos_overrides."):
            known, near = ", ".join(each for each in names if "." not in each), did_you_mean(name, names)
            raise ParameterError(f"parameter {name}: no such parameter, expected one of {known}{near}")


def _descriptor(parameter: NodeParameter) -> Any:
    low, high, bounds = parameter.low, parameter.high, None
    if low is not None and high is not None:
        bounds = (int(low), int(high)) if isinstance(parameter.default, int) else (float(low), float(high))
    about = ", ".join(filter(None, (parameter.description, plain(parameter.unit))))
    expected = f"expected {parameter.requirement()}"
    return parameter_descriptor(about, expected, bounds, fixed=not parameter.live)


def live(table: Sequence[NodeParameter], names: Collection[str]) -> tuple[NodeParameter, ...]:
    """Return a table in which parameters of these names, or limits of these quantities, may change."""
    return tuple(replace(p, live=p.name.removesuffix("_limit") in names) for p in table)


def let_change(
    node: Node, table: Sequence[NodeParameter], change: Callable[[dict[str, Any]], None]
) -> None:
    """Have live parameters of a table, also those of its joints, changed: by name, all that are set at once.

    The text of an RseaError that `change` raises is the reason why they stay as they are.
    """
    known = {p.name: p for p in table if p.live}

    def take(parameters: Sequence[Any]) -> SetParametersResult:
        asked = {p.name: (known.get(p.name.rpartition(".")[2]), p.value) for p in parameters}
        try:
            values = {name: p.check(value) for name, (p, value) in asked.items() if p is not None}
            if values:
                change(values)
        except RseaError as error:
            return SetParametersResult(successful=False, reason=str(error))
        for name, value in values.items():
            node.get_logger().info(f"parameter {name} = {value} from now on")
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(take)


def usage(name: str, table: Sequence[NodeParameter]) -> str:
    """Return the help text of a node."""
    rows = [f"  {p.name:<11} {p.description}; {p.requirement()} (default {p.default!r})" for p in table]
    return "\n".join([f"usage: ros2 run rsea_ros {name} --ros-args -p NAME:=VALUE …", "", *rows, ""])
