"""The model node with 2 s of patience for a silent topic: losses are repaired in 0.2 s here."""

from rsea_ros.nodes import _joint_inputs, model


def main() -> int:
    """Be the node."""
    _joint_inputs.PATIENCE = 2.0
    return model.main()
