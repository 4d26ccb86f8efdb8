"""Waiting for work, while other threads make and destroy what is waited for."""

import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Empty

from rsea_ros.nodes._waiter import Pulse, anything_to_do


def test_what_another_thread_has_just_destroyed_ends_no_node():
    """It was looked up, destroyed by a thread of a session, and then waited for: RCLError ended the node."""
    rclpy.init(context=(context := rclpy.Context()))
    quiet = rclpy.create_node("quiet", context=context, enable_rosout=False, start_parameter_services=False)
    executor, pulse = SingleThreadedExecutor(context=context), Pulse(context, 0.05)
    gone = quiet.create_subscription(Empty, "gone", lambda message: None, 1)
    try:
        gone.handle.destroy_when_not_in_use()
        assert gone in quiet.subscriptions
        assert not anything_to_do([quiet], executor, pulse)
    finally:
        pulse.close()
        quiet.destroy_node()
        context.shutdown()
