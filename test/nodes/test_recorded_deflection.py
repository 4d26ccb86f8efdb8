"""A bag of a driver with two encoders: the deflection is a channel, the torque computed from it is not."""

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from msg_adapters import BagWriter, read_record
from msg_adapters.ros import deflection_message, torque_command_message, wrench_message
from msg_adapters.topic_map import FIELDS, ROLES, TYPES
from rsea_ros.nodes import record
from rsea_ros.nodes._bench_topics import SPRING_FRAME

START = 1_700_000_000 * 10**9


@pytest.mark.parametrize(("frame", "kept"), [(SPRING_FRAME.default, False), ("ft_sensor", True)])
def test_a_bag_has_the_deflection_and_only_a_sensors_torque(tmp_path, frame, kept):
    angles = 0.01 * np.sin(np.arange(50) / 5.0)
    with BagWriter(tmp_path / "run.mcap") as bag:
        for k, angle in enumerate(angles):
            stamp = START + k * 3_571_429
            for topic, message in (
                ("torque_command", torque_command_message(stamp, 10.0 * angle)),
                ("deflection", deflection_message(stamp, angle, frame=SPRING_FRAME.default)),
                ("ft", wrench_message(stamp, (0.0,) * 5 + (1500.0 * angle,), frame=frame)),
            ):
                bag.write(f"/rsea/{topic}", TYPES[topic], stamp, bytes(serialize_message(message)))
    run = read_record(tmp_path / "run.mcap")
    assert run["deflection"].y == pytest.approx(angles, abs=1e-12)
    assert ("ft" in run) is kept
    told = [note for note in run.notes if "no sensor's, the stiffness of a rig times" in note]
    assert bool(told) is not kept


def test_everything_that_a_record_is_made_of_is_recorded():
    assert set(ROLES) == set(FIELDS) <= set(record.TOPICS)
