"""Coefficients of the probability of a cause (probability.py), by feature.

Written by `python bench/calibration.py fit`, from records of the project's own plants; `score` judges them.
"""

from types import MappingProxyType

COEFFICIENTS = MappingProxyType(
    {
        "intercept": -1.9193,
        "shape": -0.4801,
        "rivals": 1.0845,
        "preferred": 1.601,
        "noise": 0.2097,
        "flexible": -3.0661,
        "edge": -1.0055,
    }
)
