"""How much likelier one model is than another, what each pays for leaving known values included.

The data count by their deviance D = sum_b d_b over blocks. That of a right model against a wrong one has the
scatter S^2 = n var(d_b) = 4 D where the residual is white noise. Far from the noise floor it is none:
neighbouring samples err alike, and what one block gains another loses. There w D counts, with w = 4 D / S^2,
at most 1, whose scatter is what its size claims (magnitude adjustment: Pauli, Racugno, Ventura, Statistica
Sinica 21, 2011). Counted in full, samples by the thousand would outweigh every prior.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from rsea_ros.diagnosis.score import Score
from rsea_ros.signals import FloatArray


class Weighable(Protocol):
    """A model with its score on the validation blocks and what its fit paid for leaving known values."""

    @property
    def validation(self) -> Score: ...
    @property
    def prior_cost(self) -> float: ...


def likelier_by(model: Weighable, other: Weighable, far: float) -> float:
    """Return twice the log of the odds of a model against another.

    far: RMS of the residual over the noise, in the worst channel of both, from which the data are tempered.
    """
    gained = tempered_deviance(model.validation, other.validation, far)
    return gained + other.prior_cost - model.prior_cost


def tempered_deviance(model: Score, other: Score, far: float) -> float:
    """Return how much smaller twice the negative log likelihood of a model is than that of another.

    In the units of what the worse of the two leaves of each channel.
    """
    worse = max(model, other, key=lambda s: float(s.loss(model).sum()))
    return float((tempered_loss(other, worse, far) - tempered_loss(model, worse, far)).sum())


def tempered_loss(model: Score, against: Score, far: float) -> FloatArray:
    """Return the loss of each block of a model, shape (blocks,); its distance from another's is tempered."""
    known = against.loss(against)
    differences = model.loss(against) - known
    is_far = min(s.ratio(s.worst) for s in (model, against)) >= far
    return known + differences * (temper(differences) if is_far else 1.0)


def temper(differences: FloatArray) -> float:
    """Return the weight, up to 1, by which the sum of blocks' differences has the scatter that it claims."""
    scatter = len(differences) * float(np.var(differences, ddof=1)) if len(differences) > 1 else np.inf
    claimed = 4.0 * abs(float(differences.sum()))
    return claimed / scatter if scatter > claimed else 1.0
