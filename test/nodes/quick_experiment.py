"""The experiment node with a design of few trials: what it asks, plays and stops does not depend on it."""

from functools import partial

from rsea_ros.nodes import experiment


def main() -> int:
    """Be the node."""
    experiment.DesignRequest = partial(experiment.DesignRequest, refine=0, kinds=("multisine",))
    return experiment.main()
