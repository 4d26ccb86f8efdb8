"""The policies of nodes of which none searches gains: topics and services do not depend on them."""

from rsea_ros.nodes import _policies

GIVEN = {"k_p": 0.1, "k_d": 0.001, "k_i": 0.5, "q_frequency": 5.0, "k_w": 20.0}


def main() -> int:
    """Print the policies."""
    _policies.PARAMETERS = {**_policies.PARAMETERS, "controller": _policies.PARAMETERS["controller"] | GIVEN}
    return _policies.main()
