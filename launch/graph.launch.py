"""The graph of graph.yaml for `ros2 launch`; `first` names the executable that the measurements come from."""

from __future__ import annotations

from pathlib import Path

import yaml
from launch import LaunchDescription, Substitution
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import EqualsSubstitution, LaunchConfiguration
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent
CONFIG = HERE.parent / "config" / "nodes"
GRAPH = yaml.safe_load((HERE / "graph.yaml").read_text(encoding="utf-8"))


def generate_launch_description() -> LaunchDescription:
    """Return the first node and, each if its argument is true, the others."""
    first = LaunchConfiguration("first")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "first", description=f"source of measurements: {', '.join(GRAPH['first'])}"
            ),
            *(
                DeclareLaunchArgument(name, default_value=default.format(config=CONFIG), description=about)
                for name, (default, about) in GRAPH["arguments"].items()
            ),
            *(node(name, sets, EqualsSubstitution(first, name)) for name, sets in GRAPH["first"].items()),
            *(node(name, sets, LaunchConfiguration(name)) for name, sets in GRAPH["others"].items()),
        ]
    )


def node(name: str, sets: dict[str, str], condition: Substitution) -> Node:
    """Return a node of the package with its parameter file, started if `condition` is true.

    sets: by parameter the launch argument that sets it.
    """
    return Node(
        package="rsea_ros",
        executable=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("params") if name == "driver" else str(CONFIG / f"{name}.yaml"),
            {parameter: LaunchConfiguration(argument) for parameter, argument in sets.items()},
        ],
        condition=IfCondition(condition),
        output="screen",
    )
