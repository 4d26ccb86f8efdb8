"""Quality of service. Deep queues: a depth of 10 drops messages at 1 kHz even when it is reliable."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

COMMAND = QoSProfile(depth=200, reliability=ReliabilityPolicy.RELIABLE)
MEASUREMENT = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
RECORD = QoSProfile(depth=5000, reliability=ReliabilityPolicy.BEST_EFFORT)
RECORD_RELIABLE = QoSProfile(depth=5000, reliability=ReliabilityPolicy.RELIABLE)
"""RECORD matches every publisher; RECORD_RELIABLE only reliable ones, and then nothing is lost."""
