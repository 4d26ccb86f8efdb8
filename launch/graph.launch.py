"""The graph that all launch files share; `first` names the executable that the measurements come from."""

from __future__ import annotations

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node

CONFIG = Path(__file__).resolve().parents[1] / "config" / "nodes"
ARGUMENTS = {
    "namespace": ("rsea", "namespace of all topics"),
    "rig": ("paper_high_impedance", "the bench: a name in config/rigs or a file"),
    "bag": ("", "bag that replay plays"),
    "identify": ("true", "fit the rig to what is measured"),
    "record": ("false", "write a bag, as config/nodes/record.yaml says"),
    "excite": ("false", "move the actuator, as config/nodes/excite.yaml says"),
}


def generate_launch_description() -> LaunchDescription:
    """Return the first node and, each if its argument is true, identify, record and excite."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    others = ("identify", "record", "excite")
    return LaunchDescription(
        [
            DeclareLaunchArgument("first", description="source of measurements: plant, driver or replay"),
            *arguments,
            node(LaunchConfiguration("first")),
            *(node(name, IfCondition(LaunchConfiguration(name))) for name in others),
        ]
    )


def node(executable: str | LaunchConfiguration, condition: IfCondition | None = None) -> Node:
    """Return a node of the package with its parameter file; rig and bag go to those that declare them."""
    return Node(
        package="rsea_ros",
        executable=executable,
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            PathJoinSubstitution([str(CONFIG), [executable, ".yaml"]]),
            {"rig": LaunchConfiguration("rig"), "bag": LaunchConfiguration("bag")},
        ],
        condition=condition,
        output="screen",
    )
