"""The probability that a cause is what it is called: a logistic model of the evidence for it.

    p = 1 / (1 + exp(-(a_0 + sum_i a_i f_i)))

The features f say how far the law's shape fits (signature.py), what a flexible law still gains (flexible.py),
how it stands among its rivals (stacking.py), and how much it helps. The coefficients are those of
`bench/calibration.py fit`; "none of these" is the mass that a cause and its rivals leave.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from rsea_ros.diagnosis.coefficients import COEFFICIENTS
from rsea_ros.diagnosis.evidence import Evidence

INTERCEPT = "intercept"
_LEAST = 3e-3
"""Spread of lambda that two right simulations of one law have at least (MODEL_DOUBT in conclusion.py)."""
_FARTHEST = 30.0
"""Times the noise: what is farther off says no more."""
_SUREST = 4.0
"""Log odds among rivals: what is more certain says no more, for all of them may be wrong."""


def features(e: Evidence) -> dict[str, float]:
    """Return the numbers that the logistic model weighs, by name."""
    s, flexible = e.signature, e.flexible
    beyond = math.sqrt(max(s.overall**2 - s.chance**2, 0.0))
    bent = max(s.amplitude, s.time, s.frequency)
    sure = flexible.gain if flexible and flexible.ci95[0] > 0.0 else 0.0
    return {
        INTERCEPT: 1.0,
        "spread": math.log((_LEAST + min(beyond, 3.0)) / 0.1),
        "chance": math.log((_LEAST + min(s.chance, 3.0)) / 0.1),
        "bent": math.log((_LEAST + min(bent, 3.0)) / 0.1),
        "rivals": _logit(e.weight),
        "flexible": sure,
        "gain": min(max(e.gain_low, -0.2), 1.0),
        "left": math.log(min(max(e.left, 1.0), _FARTHEST)),
        "edge": float(e.at_edge),
    }


def _logit(weight: float) -> float:
    inside = min(max(weight, 1e-9), 1.0 - 1e-9)
    return min(max(math.log(inside / (1.0 - inside)), -_SUREST), _SUREST)


def probability(e: Evidence, coefficients: Mapping[str, float] = COEFFICIENTS) -> float:
    """Return the probability that the cause is part of the truth under its name, 0 to 1."""
    odds = sum(coefficients.get(name, 0.0) * value for name, value in features(e).items())
    return 1.0 / (1.0 + math.exp(-min(max(odds, -30.0), 30.0)))
