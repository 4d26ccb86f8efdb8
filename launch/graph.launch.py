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
    "device": ("dynamixel_netft", "what the driver drives: dynamixel_netft or simulated"),
    "port": ("/dev/ttyUSB0", "serial port of the motor"),
    "baud": ("1000000", "of the serial port, as the motor is set, bit/s"),
    "ft_host": ("192.168.1.1", "address of the F/T sensor"),
    "activate": ("false", "switch the driver's torque on at once; else by its lifecycle"),
    "params": (str(CONFIG / "driver.yaml"), "parameter file of the driver; the arguments above win"),
    "model": ("true", "estimate the torques, and say whether the actuator is a pure torque source"),
    "identify": ("true", "fit the rig to what is measured"),
    "controller": ("false", "make the torque follow desired_torque"),
    "record": ("false", "write a bag, as config/nodes/record.yaml says"),
    "excite": ("false", "move the actuator, as config/nodes/excite.yaml says"),
}


RIG = {"rig": "rig"}
DRIVER = {name: name for name in ("rig", "device", "port", "baud", "ft_host")} | {"autostart": "activate"}
FIRST = {"plant": RIG, "driver": DRIVER, "replay": {"bag": "bag"}}
OTHERS: dict[str, dict[str, str]] = {
    "model": RIG, "identify": RIG, "controller": RIG, "record": {}, "excite": {},
}  # fmt: skip
"""Executables, and for parameters of theirs the launch arguments that set them."""


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


def node(name: str, own: dict[str, str], wanted: Substitution) -> Node:
    """Return a node of the package with its parameter file, started if `wanted` is true."""
    return Node(
        package="rsea_ros",
        executable=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("params") if name == "driver" else str(CONFIG / f"{name}.yaml"),
            {parameter: LaunchConfiguration(argument) for parameter, argument in own.items()},
        ],
        condition=IfCondition(wanted),
        output="screen",
    )
