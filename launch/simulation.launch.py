"""The bench simulated: the plant node in front of the graph.

ros2 launch rsea_ros simulation.launch.py rig:=paper_moving_output excite:=true record:=true
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

GRAPH = Path(__file__).resolve().with_name("graph.launch.py")


def generate_launch_description() -> LaunchDescription:
    """Return the shared graph behind the plant node."""
    graph = PythonLaunchDescriptionSource(str(GRAPH))
    return LaunchDescription([IncludeLaunchDescription(graph, launch_arguments=[("first", "plant")])])
