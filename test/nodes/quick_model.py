"""The model node with 5 s of patience for a silent topic, a second less than its own."""

from rsea_ros.nodes import _joint_inputs, model


def main() -> int:
    """Be the node."""
    _joint_inputs.PATIENCE = 5.0
    return model.main()
