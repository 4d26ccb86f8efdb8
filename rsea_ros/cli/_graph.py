"""Graphs of nodes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rsea_ros.documents import strict_yaml
from rsea_ros.documents.wording import did_you_mean, list_names
from rsea_ros.errors import ParameterError, RseaError


@dataclass(frozen=True)
class NodeCall:
    """A node to start. `parameters` override the parameter file."""

    name: str
    namespace: str
    file: Path
    parameters: Mapping[str, str]

    @property
    def arguments(self) -> list[str]:
        given = [word for name, value in self.parameters.items() for word in ("-p", f"{name}:={value}")]
        namespace = f"__ns:=/{self.namespace.strip('/')}"
        return ["--ros-args", "-r", namespace, "--params-file", str(self.file), *given]


def graph_names() -> Sequence[str]:
    """Return the names of the graphs: simulation, hardware, replay."""
    return tuple(_graph()["graphs"])


def arguments_of_graphs() -> Mapping[str, tuple[str, str]]:
    """Return default and meaning of every argument by name."""
    return {
        name: (default.format(config=_config()), about)
        for name, (default, about) in _graph()["arguments"].items()
    }


def node_calls(graph: str, assignments: Sequence[str]) -> list[NodeCall]:
    """Return the nodes of a graph for arguments of the form `name:=value`.

    Raises ParameterError for a graph or an argument that does not exist.
    """
    names = graph_names()
    if graph not in names:
        raise ParameterError(
            f"graph {graph!r}, expected {list_names(names, 'or')}{did_you_mean(graph, names)}"
        )
    values = {name: default for name, (default, _) in arguments_of_graphs().items()}
    values |= _parse_assignments(assignments)
    content = _graph()
    first = content["graphs"][graph]
    chosen = {first: content["first"][first]}
    chosen |= {name: settings for name, settings in content["others"].items() if _is_true(name, values[name])}
    return [_call(name, settings, values) for name, settings in chosen.items()]


def _parse_assignments(assignments: Sequence[str]) -> dict[str, str]:
    known = arguments_of_graphs()
    given: dict[str, str] = {}
    for assignment in assignments:
        name, sign, value = assignment.partition(":=")
        if not sign:
            raise ParameterError(f"argument {assignment!r}, expected NAME:=VALUE")
        if name not in known:
            near = did_you_mean(name, known)
            raise ParameterError(f"argument {name!r}, expected one of {', '.join(known)}{near}")
        given[name] = value
    return given


def _call(name: str, settings: Mapping[str, str], values: Mapping[str, str]) -> NodeCall:
    file = Path(values["params"]) if name == "driver" else _config() / f"{name}.yaml"
    parameters = {parameter: values[argument] for parameter, argument in settings.items()}
    return NodeCall(name, values["namespace"], file, parameters)


def _is_true(name: str, value: str) -> bool:
    if value.lower() not in ("true", "false"):
        raise ParameterError(f"{name}:={value}, expected true or false")
    return value.lower() == "true"


def _graph() -> Mapping[str, Any]:
    content: Mapping[str, Any] = strict_yaml.read(_share() / "launch" / "graph.yaml").content
    return content


def _config() -> Path:
    return _share() / "config" / "nodes"


def parameters_of_bench() -> Path:
    """Return the file of the parameters that a driver needs on `rsea bench`."""
    return _share() / "config" / "simulated_bench.yaml"


def _share() -> Path:
    """Return the folder of config/ and launch/: the clone, or the share of the installed package."""
    from rsea_ros.model.rig_file import rig_folders  # and a compiler, for which a stop must not wait

    return next(folder.parents[1] for folder in rig_folders())


def need_ros() -> None:
    """Raise RseaError if rclpy is missing."""
    if find_spec("rclpy") is None:
        raise RseaError("rclpy is missing, expected a sourced ROS 2, or ./rsea in a clone on x86_64")
