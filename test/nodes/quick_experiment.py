"""The experiment node with a design of few trials, that hears runs no longer than it must.

What it asks, plays and stops does not depend on that.
"""

from functools import partial

from rsea_ros.nodes import _player, experiment


def main() -> int:
    """Be the node."""
    experiment.DesignRequest = partial(experiment.DesignRequest, refine=0, kinds=("multisine",))
    _player.SHORTEST = 0.0
    return experiment.main()
