"""Coefficients of the probability of a cause (probability.py), by feature.

Written by `python bench/calibration.py fit`, from records of the project's own plants; `score` judges them.
"""

from types import MappingProxyType

COEFFICIENTS = MappingProxyType(
    {
        "intercept": 0.0,
        "spread": -1.0,
        "chance": -0.3,
        "bent": -0.5,
        "rivals": 0.5,
        "flexible": -4.0,
        "gain": 1.0,
        "left": -0.5,
        "edge": -1.0,
    }
)
