"""What a verb of the command line is made of."""

from rsea_ros.cli._options import FOUND, RIG, Action, add_fail_on, add_force, path, results_place, verb_of
from rsea_ros.cli._processes import need_ros, parameter_words
from rsea_ros.cli._terminal import columns, positive, progress, say, whole_number
from rsea_ros.cli.run import become

__all__ = [
    "FOUND", "RIG", "Action", "add_fail_on", "add_force", "become", "columns", "need_ros",
    "parameter_words", "path", "positive", "progress", "results_place", "say", "verb_of", "whole_number",
]  # fmt: skip
