"""Coefficients of the probability of a cause (probability.py), by feature.

Written by `python bench/calibration.py fit`, from records of the project's own plants; `score` tests them.
"""

from types import MappingProxyType

COEFFICIENTS = MappingProxyType(
    {
        "intercept": -1.9062,
        "shape": -0.5554,
        "rivals": 0.5793,
        "preferred": 2.3893,
        "noise": 0.5576,
        "flexible": -2.9564,
        "edge": -1.0734,
    }
)
