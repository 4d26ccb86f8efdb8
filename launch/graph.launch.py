"""The graph that all launch files share; `first` names the executable that the measurements come from."""

from __future__ import annotations

from pathlib import Path

from launch import LaunchDescription, Substitution
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import EqualsSubstitution, LaunchConfiguration
from launch_ros.actions import Node

CONFIG = Path(__file__).resolve().parents[1] / "config" / "nodes"
ARGUMENTS = {
    "namespace": ("rsea", "namespace of all topics"),
    "rig": ("paper_high_impedance", "the bench: a name in config/rigs or a file"),
    "bag": ("", "bag that replay plays"),
    "model": ("true", "estimate the torques, and say whether the actuator is a pure torque source"),
    "identify": ("true", "fit the rig to what is measured"),
    "controller": ("false", "make the torque follow desired_torque"),
    "record": ("false", "write a bag, as config/nodes/record.yaml says"),
    "excite": ("false", "move the actuator, as config/nodes/excite.yaml says"),
}


FIRST = {"plant": "rig", "driver": "rig", "replay": "bag"}
OTHERS = {"model": "rig", "identify": "rig", "controller": "rig", "record": None, "excite": None}
"""Executables, and the launch argument that is a parameter of theirs."""


def generate_launch_description() -> LaunchDescription:
    """Return the first node and, each if its argument is true, the others."""
    first = LaunchConfiguration("first")
    return LaunchDescription(
        [
            DeclareLaunchArgument("first", description=f"source of measurements: {', '.join(FIRST)}"),
            *(
                DeclareLaunchArgument(name, default_value=default, description=description)
                for name, (default, description) in ARGUMENTS.items()
            ),
            *(node(name, own, EqualsSubstitution(first, name)) for name, own in FIRST.items()),
            *(node(name, own, LaunchConfiguration(name)) for name, own in OTHERS.items()),
        ]
    )


def node(name: str, own: str | None, wanted: Substitution) -> Node:
    """Return a node of the package with its parameter file, started if `wanted` is true."""
    return Node(
        package="rsea_ros",
        executable=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[str(CONFIG / f"{name}.yaml"), {own: LaunchConfiguration(own)} if own else {}],
        condition=IfCondition(wanted),
        output="screen",
    )
