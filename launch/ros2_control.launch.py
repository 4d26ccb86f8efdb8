"""ros2_control in front of a running driver: docs/hardware.md.

ros2 launch rsea_ros ros2_control.launch.py namespace:=/rsea
Needs xacro, robot_state_publisher, ros2_control, ros2_controllers. hardware.launch.py starts the driver.
"""

from __future__ import annotations

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import Command, LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

CONFIG = Path(__file__).resolve().parents[1] / "config" / "ros2_control"
CONTROLLERS = str(CONFIG / "controllers.yaml")
ARGUMENTS = {
    "plugin": (
        "joint_state_topic_hardware_interface/JointStateTopicSystem",
        "of the hardware; Humble: topic_based_ros2_control/TopicBasedSystem",
    ),
    "namespace": ("/rsea", "of driver and model"),
    "joint": ("joint", "as the driver's parameter; another one also in controllers.yaml"),
    "estimates": ("false", "whether torque_estimate of the node model is a state; not in Humble"),
}
"""By name: default and meaning; the arguments of rsea.urdf.xacro."""


def generate_launch_description() -> LaunchDescription:
    """Return robot description, controller manager and controllers."""
    values = [part for name in ARGUMENTS for part in (f" {name}:=", LaunchConfiguration(name))]
    xacro = Command(["xacro ", str(CONFIG / "rsea.urdf.xacro"), *values])
    robot = {"robot_description": ParameterValue(xacro, value_type=str)}
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=about)
                for name, (default, about) in ARGUMENTS.items()
            ),
            Node(package="robot_state_publisher", executable="robot_state_publisher", parameters=[robot]),
            Node(
                package="controller_manager",
                executable="ros2_control_node",
                parameters=[robot, CONTROLLERS],
                remappings=[("~/robot_description", "/robot_description")],
                output="screen",
            ),
            spawner("joint_state_broadcaster"),
            spawner("effort_controller"),
            spawner("torque_broadcaster", condition=IfCondition(LaunchConfiguration("estimates"))),
        ]
    )


def spawner(controller: str, condition: IfCondition | None = None) -> Node:
    """Return what loads and activates a controller."""
    return Node(
        package="controller_manager",
        executable="spawner",
        arguments=[controller, "--param-file", CONTROLLERS],
        condition=condition,
    )
