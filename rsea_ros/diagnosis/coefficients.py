"""Coefficients of the probability of a cause (probability.py), by feature.

Written by `python bench/calibration.py fit`, from records of the project's own plants; `score` judges them.
"""

from types import MappingProxyType

COEFFICIENTS = MappingProxyType(
    {
        "intercept": -1.7624,
        "shape": -0.4985,
        "rivals": 1.0933,
        "preferred": 1.8044,
        "noise": 0.0708,
        "flexible": -2.811,
        "edge": -1.0853,
    }
)
