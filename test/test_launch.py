"""The launch files describe one graph. `launch` is not among the wheels: stand-ins record their arguments."""

from __future__ import annotations

import importlib
import importlib.util
import re
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from rsea_ros.plugins import node_modules

ROOT = Path(__file__).resolve().parents[1]
LAUNCH = ROOT / "launch"
API = {
    "launch": ["LaunchDescription", "Substitution"],
    "launch.actions": ["DeclareLaunchArgument", "IncludeLaunchDescription"],
    "launch.conditions": ["IfCondition"],
    "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
    "launch.substitutions": ["Command", "EqualsSubstitution", "LaunchConfiguration"],
    "launch_ros": [],
    "launch_ros.actions": ["Node"],
    "launch_ros.parameter_descriptions": ["ParameterValue"],
}


class Part:
    """An action or a substitution: its kind and what it was made from."""

    def __init__(self, kind: str, *arguments: Any, **options: Any) -> None:
        self.kind, self.arguments, self.options = kind, arguments, options


@pytest.fixture
def describe(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], list[Part]]:
    """Return a function that gives the parts that a launch file describes."""
    for name, kinds in API.items():
        module = types.ModuleType(name)
        for kind in kinds:
            setattr(module, kind, lambda *a, kind=kind, **o: Part(kind, *a, **o))
        monkeypatch.setitem(sys.modules, name, module)

    def parts(name: str) -> list[Part]:
        spec = importlib.util.spec_from_file_location(name.replace(".", "_"), LAUNCH / f"{name}.launch.py")
        assert spec and spec.loader
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return list(module.generate_launch_description().arguments[0])

    return parts


def configurations(part: Any) -> set[str]:
    """Return the names of the launch arguments that a part uses, at any depth."""
    if isinstance(part, Part):
        parameters = {part.arguments[0]} if part.kind == "LaunchConfiguration" else set()
        return parameters | configurations([part.arguments, part.options])
    if isinstance(part, dict):
        return configurations(list(part.values()))
    return set().union(*map(configurations, part)) if isinstance(part, list | tuple) else set()


def defaults(parts: list[Part]) -> dict[str, str | None]:
    """Return the default of every launch argument that is declared; None where one must be given."""
    declared = (part for part in parts if part.kind == "DeclareLaunchArgument")
    return {part.arguments[0]: part.options.get("default_value") for part in declared}


FIRST = {"simulation": "plant", "hardware": "driver", "replay": "replay"}


@pytest.mark.parametrize(("name", "first"), FIRST.items())
def test_a_launch_file_is_the_graph_behind_its_first_node(describe, name, first):
    (include,) = describe(name)
    assert include.kind == "IncludeLaunchDescription"
    assert include.arguments[0].arguments == (str(LAUNCH / "graph.launch.py"),)
    assert include.options["launch_arguments"] == [("first", first)]


def test_the_graph_declares_every_argument_that_it_uses(describe):
    parts = describe("graph")
    assert configurations(parts) == set(defaults(parts))


def test_only_the_first_node_model_and_identify_start_by_default(describe):
    parts = describe("graph")
    wanted = {name: node["condition"].arguments[0] for name, node in nodes(parts).items()}
    for name in FIRST.values():
        first, value = wanted.pop(name).arguments
        assert (configurations(first), value) == ({"first"}, name)
    assert {name: configurations(part) for name, part in wanted.items()} == {name: {name} for name in wanted}
    assert {name: defaults(parts)[name] for name in wanted} == {
        "model": "true",
        "identify": "true",
        "health": "false",
        "controller": "false",
        "record": "false",
        "excite": "false",
    }


def test_a_node_gets_a_parameter_file_and_parameters_that_it_declares(describe):
    for name, node in nodes(describe("graph")).items():
        file, parameters = node["parameters"]
        if isinstance(file, Part):
            file = defaults(describe("graph"))[file.arguments[0]]
        given = set(yaml.safe_load(Path(file).read_text())["/**"]["ros__parameters"]) | set(parameters)
        table = importlib.import_module(node_modules()[name]).TABLE
        assert given <= {parameter.name for parameter in table}, name


def test_hardware_launches_a_real_device_and_activates_it_only_on_request(describe):
    """It started the simulation whatever was connected."""
    parts = describe("graph")
    parameters = nodes(parts)["driver"]["parameters"][1]
    given = {name: defaults(parts)[part.arguments[0]] for name, part in parameters.items()}
    assert given["device"] == "dynamixel_netft" and given["autostart"] == "false"
    assert {"port", "baud", "ft_host", "rig"} < set(given)


def test_ros2_control_is_launched_with_files_arguments_and_controllers_that_exist(describe):
    parts = describe("ros2_control")
    assert configurations(parts) == set(defaults(parts))
    manager = nodes(parts)["ros2_control_node"]["parameters"]
    program, description, *_ = manager[0]["robot_description"].arguments[0].arguments[0]
    xacro = Path(description).read_text()
    stated = re.findall(r'<xacro:arg name="(\w+)" default="([^"]*)"/>', xacro)
    assert program == "xacro " and dict(stated) == defaults(parts)
    kinds = yaml.safe_load(Path(manager[1]).read_text())["controller_manager"]["ros__parameters"]
    spawned = [part.options["arguments"][0] for part in parts if part.options.get("executable") == "spawner"]
    assert len(set(spawned)) == 3 and all(kinds[name]["type"] for name in spawned)


def nodes(parts: list[Part]) -> dict[str, dict[str, Any]]:
    """Return the options of every node by executable."""
    return {part.options["executable"]: part.options for part in parts if part.kind == "Node"}
