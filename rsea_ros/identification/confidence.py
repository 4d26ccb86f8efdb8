"""How sure a fit is, and what its data cannot tell.

The covariance is the sandwich H^-1 (sum_b g_b g_b' + W^2) H^-1 with H = J'J + W^2, W the inverse prior
doubts, and g_b = J_b' r_b the scores of blocks of one second: right also where the residual is coloured or
larger than the noise (White, Econometrica 48, 1980; Newey and West 1987). Never less than H^-1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Solution
from rsea_ros.identification.unknowns import Unknown
from rsea_ros.signals import FloatArray

BLOCK = 1.0
"""s. Residuals further apart than this are taken as independent."""
_Z95 = 1.959964
_TOLD = 0.5
"""Below this share the prior, not the data, decides a parameter."""


@dataclass(frozen=True)
class Confidence:
    """Covariance in the fit's coordinates, shape (n, n), and by unknown the share that the data told."""

    covariance: FloatArray
    told: FloatArray
    information: FloatArray

    @property
    def correlation(self) -> FloatArray:
        """Return the correlation matrix."""
        sd = np.sqrt(np.diag(self.covariance))
        result: FloatArray = self.covariance / np.outer(sd, sd)
        return result


def confidence_of(solution: Solution) -> Confidence:
    """Return the doubt that is left after a fit."""
    doubt = np.array([u.doubt for u in solution.problem.unknowns])
    prior = np.diag(1.0 / doubt**2)
    information = solution.jacobian.T @ solution.jacobian
    inverse = np.linalg.pinv(information + prior, hermitian=True)
    covariance = inverse @ (_block_scores(solution) + prior) @ inverse
    larger = np.sqrt(np.maximum(1.0, np.diag(inverse) / np.maximum(np.diag(covariance), 1e-300)))
    covariance = covariance * np.outer(larger, larger)
    told = 1.0 - np.diag(covariance) / doubt**2
    return Confidence(covariance, np.clip(told, 0.0, 1.0), information)


def _block_scores(solution: Solution) -> FloatArray:
    blocks = sample_blocks(solution.problem, BLOCK)
    scores = np.zeros((blocks.max() + 1, solution.jacobian.shape[1]))
    np.add.at(scores, blocks, solution.jacobian * solution.residual[:, None])
    result: FloatArray = scores.T @ scores
    return result


def sample_blocks(problem: Problem, length: float) -> FloatArray:
    """Return for every residual the number of the block of `length` s that it lies in, all cases in a row."""
    parts, first = [], 0
    for case in problem.cases:
        starts = [np.floor((case.t[n][case.mask[n]] - case.start) / length) for n in problem.present(case)]
        parts += [first + np.maximum(s, 0).astype(np.int64) for s in starts]
        first += int(case.duration / length) + 2
    return np.concatenate(parts)


def interval(unknown: Unknown, coordinate: float, sd: float) -> tuple[float, float]:
    """Return the 95 % interval in SI."""
    return unknown.outer(coordinate - _Z95 * sd), unknown.outer(coordinate + _Z95 * sd)


def what_is_not_told(unknowns: Sequence[Unknown], confidence: Confidence) -> tuple[str, ...]:
    """Return plain sentences on what the data cannot tell, and what would make it so.

    The eigenvectors of the data's information, in units of the prior, whose information is less than the
    prior's: a common factor of several values cannot be told, only their ratios, or a single value not.
    """
    index = [i for i, u in enumerate(unknowns) if np.isfinite(u.doubt) and not u.name.startswith("clock.")]
    if not index:
        return ()
    doubt = np.array([unknowns[i].doubt for i in index])
    scaled = _without_the_rest(confidence.information, index) * np.outer(doubt, doubt)
    values, vectors = np.linalg.eigh(scaled)
    sentences = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value < 1.0:
            involved = [unknowns[index[k]].name for k in range(len(index)) if abs(vector[k]) > 0.25]
            sentences.append(_sentence(involved))
    return tuple(sentences)


def _without_the_rest(information: FloatArray, index: Sequence[int]) -> FloatArray:
    """Return the information on `index` with all other unknowns free (Schur complement)."""
    rest = [i for i in range(len(information)) if i not in index]
    own, cross = information[np.ix_(index, index)], information[np.ix_(index, rest)]
    if not rest:
        return own
    result: FloatArray = own - cross @ np.linalg.pinv(information[np.ix_(rest, rest)], hermitian=True) @ cross.T
    return result


def _sentence(names: Sequence[str]) -> str:
    if len(names) == 1:
        return f"{names[0]} is not identifiable from these data: what is known of it is the rig's prior. {_REMEDY.get(names[0], _MEASURE)}"
    listed = ", ".join(names[:-1]) + " and " + names[-1]
    return (
        f"Only ratios of {listed} are identifiable from these data: a common factor is taken from the rig. "
        "A measured spring stiffness, the encoder (position), or a known inertia would fix it."
    )


_MEASURE = "Measure it apart, or excite it more."
_REMEDY = {
    "spring.damping": "More excitation above the resonance, or the F/T sensor together with the encoder, would tell it.",
    "housing_end.damping": "A free swing of the housing would tell it.",
}
