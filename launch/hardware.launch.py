"""The real bench: the driver node in front of the graph.

ros2 launch rsea_ros hardware.launch.py rig:=my_rig.yaml port:=/dev/ttyUSB0 ft_host:=192.168.1.1 record:=true
The driver is a lifecycle node: it powers the actuator only when it is activated, or with activate:=true.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

GRAPH = Path(__file__).resolve().with_name("graph.launch.py")


def generate_launch_description() -> LaunchDescription:
    """Return the shared graph behind the driver node."""
    graph = PythonLaunchDescriptionSource(str(GRAPH))
    return LaunchDescription([IncludeLaunchDescription(graph, launch_arguments=[("first", "driver")])])
