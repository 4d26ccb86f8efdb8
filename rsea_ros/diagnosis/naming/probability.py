"""The probability that the name of a cause is right: a logistic model of its evidence.

    p = 1 / (1 + exp(-(a_0 + sum_i a_i f_i)))

The features f are the fit of the law's shape (signature.py), the further gain of a flexible law
(flexible.py), its odds among its rivals (rivals.py), and its gain. The coefficients are those of
`bench/calibration.py fit`; "none of these" is the mass that a cause and its rivals leave.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from rsea_ros.diagnosis.naming.coefficients import COEFFICIENTS
from rsea_ros.diagnosis.naming.evidence import Evidence
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings, EvidenceSettings

INTERCEPT = "intercept"
_CERTAIN = 30.0
"""Log odds from which no number of this machine differs from certainty."""


def features(e: Evidence, preferred: bool, settings: DiagnosisSettings = DEFAULT) -> dict[str, float]:
    """Return the numbers that the logistic model weighs, by name. preferred: the search chose it.

    shape: spread of lambda. rivals: log odds among them, reduced with the distance from the noise floor,
    because the residual there is not noise, and more parameters always fit a little of it. noise: its model
    leaves only noise. flexible: sure gain of a spline beside it. edge: a parameter is at a bound.
    """
    s, flexible, rule = e.signature, e.flexible, settings.evidence
    bent = max(s.amplitude, s.time, s.frequency)
    return {
        INTERCEPT: 1.0,
        "shape": 0.5 * (_relative(s.overall, rule) + _relative(bent, rule)),
        "rivals": _log_odds(e.weight, rule.surest) / max(e.left, 1.0),
        "preferred": float(preferred),
        "noise": float(e.left <= settings.floor.reached),
        "flexible": flexible.gain if flexible and flexible.ci95[0] > 0.0 else 0.0,
        "edge": float(e.at_edge),
    }


def _relative(spread: float, rule: EvidenceSettings) -> float:
    """Return the logarithm of a spread of lambda over 0.1."""
    return math.log((rule.least_spread + min(spread, rule.most_spread)) / 0.1)


def _log_odds(weight: float, surest: float) -> float:
    inside = min(max(weight, 1e-9), 1.0 - 1e-9)
    return min(max(math.log(inside / (1.0 - inside)), -surest), surest)


def probability(
    e: Evidence,
    preferred: bool,
    coefficients: Mapping[str, float] = COEFFICIENTS,
    settings: DiagnosisSettings = DEFAULT,
) -> float:
    """Return the probability that the cause is part of the truth under its name, 0 to 1."""
    odds = sum(coefficients[name] * value for name, value in features(e, preferred, settings).items())
    return 1.0 / (1.0 + math.exp(-min(max(odds, -_CERTAIN), _CERTAIN)))
