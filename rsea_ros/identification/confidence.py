"""The confidence of a fit, its estimates with intervals, and the values that its data cannot determine.

The covariance is the sandwich H^-1 (sum_b g_b g_b' + W^2) H^-1 with H = J'J + W^2, W the inverse prior
doubts, and g_b = J_b' r_b the scores of blocks of one second: right also where the residual is coloured or
larger than the noise (White, Econometrica 48, 1980; Newey and West 1987), times n / (n - p) for n blocks and
p unknowns (MacKinnon and White, J. Econometrics 29, 1985). Never less than H^-1.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from rsea_ros.documents.units import in_motion, with_unit
from rsea_ros.identification import result as results
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import Map, Solution, central_jacobian, serial
from rsea_ros.identification.unknowns import Unknown, apply
from rsea_ros.model.drive import Drive
from rsea_ros.model.inverse import CUT_OFF
from rsea_ros.model.rig import FIELDS, Quantity, Rig, field_of
from rsea_ros.records.record import FloatArray, IntArray
from rsea_ros.records.statistics import Z95

_WEAK = 100.0
"""Of the prior's information: below it forward differences may take curvature for information."""
_INVOLVED = 0.2
"""A parameter moves along with an undetermined direction when it moves at least so much of the largest."""
_ALIKE = 0.8
"""Values share a factor when the one that moves least moves so much of the one that moves most."""


@dataclass(frozen=True)
class Confidence:
    """Covariance in the fit's coordinates, shape (n, n), and by unknown the share determined by the data.

    data_share: by determined.shares_from_data. information: J'J, shape (n, n). theta: where the fit
    ended, shape (n,).
    """

    theta: FloatArray
    covariance: FloatArray
    data_share: FloatArray
    information: FloatArray

    @property
    def correlation(self) -> FloatArray:
        """Return the correlation matrix; a value without doubt is correlated with none."""
        sd = np.sqrt(np.diag(self.covariance))
        scale = np.outer(sd, sd)
        return np.asarray(np.divide(self.covariance, scale, out=np.eye(len(sd)), where=scale > 0.0))


BLOCK = 1.0
"""s: residuals further apart are taken as independent, longer than a bench's memory."""
_MOST_CORRECTED = 4.0
"""Largest factor n / (n - p) on the variance, for n blocks and p unknowns, an interval twice as wide: with
fewer than 4/3 p blocks the factor runs away."""


def confidence_of(solution: Solution, run: Map = serial) -> Confidence:
    """Return the doubt that is left after a fit."""
    doubt = np.array([u.reach for u in solution.problem.unknowns])
    prior = np.diag(1.0 / doubt**2)
    information = solution.jacobian.T @ solution.jacobian
    if np.linalg.eigvalsh(information * np.outer(doubt, doubt))[0] < _WEAK:
        solution = replace(solution, jacobian=central_jacobian(solution.problem, solution.theta, run))
        information = solution.jacobian.T @ solution.jacobian
    inverse = inverse_of(information + prior)
    spread = inverse @ np.hstack([_block_scores(solution).T, np.sqrt(prior)])
    covariance = spread @ spread.T  # no rounding makes a variance of this product negative
    least = np.diag(inverse) * max(_alike(case) for case in solution.problem.cases)
    least = np.minimum(least, np.maximum(np.diag(inverse), doubt**2))
    larger = np.sqrt(np.maximum(1.0, least / np.maximum(np.diag(covariance), 1e-300)))
    covariance = covariance * np.outer(larger, larger)
    return Confidence(solution.theta, covariance, results.shares_from_data(information, doubt), information)


def inverse_of(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a positive definite matrix whose unknowns may be scaled very differently.

    Each unknown is brought to the scale of its own diagonal first: otherwise a value that only wide bounds
    hold is taken for a singular direction beside one that is known well. An eigenvalue lost in rounding
    counts as the smallest resolvable one, which leaves a wide variance and never zero.
    """
    scale = 1.0 / np.sqrt(np.diag(matrix))
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    values = np.maximum(values, len(values) * np.finfo(float).eps * values[-1])
    return np.asarray((vectors / values) @ vectors.T * np.outer(scale, scale))


def _alike(case: Case) -> float:
    """Return how many samples of a case count as one independent sample: a filter correlates them."""
    drive = case.drive
    return 1.0 if isinstance(drive, Drive) else max(1.0, 0.5 / (CUT_OFF * float(drive.t[1] - drive.t[0])))


def _block_scores(solution: Solution) -> FloatArray:
    """Return the score of each block, shape (blocks, unknowns): S'S is the scatter of their sum."""
    blocks = sample_blocks(solution.problem, BLOCK)
    scores = sum_by_block(solution.jacobian, solution.residual, blocks)
    counted = len(np.unique(blocks))
    free = max(counted - len(solution.theta), counted / _MOST_CORRECTED)
    return np.asarray(scores * np.sqrt(counted / free))


def sum_by_block(matrix: FloatArray, residual: FloatArray, blocks: IntArray) -> FloatArray:
    """Return the score of every block, the sum of derivative times residual, shape (blocks, unknowns)."""
    rows = [np.bincount(blocks, column * residual).astype(np.float64) for column in matrix.T]
    return np.column_stack(rows) if rows else np.zeros((int(blocks.max()) + 1, 0))


def sample_blocks(problem: Problem, length: float) -> IntArray:
    """Return for every residual the number of the block of `length` s that it lies in, all cases in a row."""
    parts, first = [], 0
    for case in problem.cases:
        starts = [np.floor((case.t[n][case.mask[n]] - case.start) / length) for n in problem.present(case)]
        parts += [first + np.maximum(s, 0).astype(np.int64) for s in starts]
        first += int(case.duration / length) + 2
    return np.concatenate(parts)


def interval(unknown: Unknown, coordinate: float, sd: float) -> tuple[float, float]:
    """Return the 95 % interval in SI, of an angle half a turn either way at most."""
    if unknown.is_cyclic:
        middle, half = unknown.outer(coordinate), min(Z95 * sd, math.pi)
        return middle - half, middle + half
    return unknown.outer(coordinate - Z95 * sd), unknown.outer(coordinate + Z95 * sd)


def undetermined_remarks(unknowns: Sequence[Unknown], confidence: Confidence) -> tuple[results.Remark, ...]:
    """Return remarks on values that the data cannot determine.

    The eigenvectors of the data's information, in units of the prior, whose information is less than the
    prior's: of several values only ratios are determined, or only all together, or a single value is not.
    """
    theta = confidence.theta
    asked = [i for i, u in enumerate(unknowns) if not u.is_clock]
    stuck = [i for i in asked if unknowns[i].at_bound(float(theta[i]))]
    index = [i for i in asked if i not in stuck]
    remarks = [results.Remark("at_bound", (u.name,), (u.outer(float(theta[i])),), u.unit)
               for i, u in enumerate(unknowns) if i in stuck]  # fmt: skip
    reach = np.array([unknowns[i].reach for i in index])
    pairs = [(unknowns[i], abs(float(theta[i]))) for i in index]  # near 0 a typical size is the reference
    size = np.array([1.0 if u.logarithmic else max(value, 0.1 * u.scale) for u, value in pairs])
    scaled = _without_the_rest(confidence.information, index) * np.outer(reach, reach)
    values, vectors = np.linalg.eigh(scaled)
    for vector in vectors[:, values < 1.0].T:
        moved = np.abs(vector * reach / size)
        involved = [unknowns[index[k]] for k in np.flatnonzero(moved > _INVOLVED * moved.max())]
        remarks.append(_remark(involved, moved[moved > _INVOLVED * moved.max()]))
    return tuple(remarks)


def torque_scale(problem: Problem) -> tuple[results.Remark, ...]:
    """Return a remark on the basis of every torque without an F/T sensor, where no fit needs one.

    The motor's torque is its current times a constant, which it cannot determine.
    """
    fitted = any(u.name.startswith("torque_constant_error.") for u in problem.unknowns)
    if fitted or any("ft" in case.measured for case in problem.cases):
        return ()
    by_constant = problem.rig.loop is None
    return (results.Remark("torque_by_motor_constant" if by_constant else "torque_by_loop_gains"),)


def stated_differences(problem: Problem) -> tuple[results.Remark, ...]:
    """Return a remark for each record that differs as stated, and one on conditions of other records."""
    here = {PurePath(case.source).name for case in problem.cases}
    others = tuple(c.record for c in problem.rig.conditions if c.record not in here)
    remarks = []
    for c in (c for c in problem.rig.conditions if c.record in here):
        known = {f"{n} =": (n, q.value) for n, q in c.values.items() if not q.spread}
        known |= {f"{n} larger by": (n, value) for n, value in c.added.items()}
        told = [f"{how} {with_unit(f'{v:.4g}', FIELDS[n].unit)}" for how, (n, v) in known.items()]
        told += [f"{n} fitted for it alone" for n, q in c.values.items() if q.spread]
        told += [f"no {name}" for name in sorted(c.without)]
        remarks += [results.Remark("differs", (c.record, *told))] if told else []
    return (*remarks, *([results.Remark("other_records", others)] if others else []))


def _without_the_rest(information: FloatArray, index: Sequence[int]) -> FloatArray:
    """Return the information on `index` with all other unknowns free (Schur complement)."""
    rest = [i for i in range(len(information)) if i not in index]
    chosen, cross = information[np.ix_(index, index)], information[np.ix_(index, rest)]
    inverse = np.linalg.pinv(information[np.ix_(rest, rest)], hermitian=True)
    return np.asarray(chosen - cross @ inverse @ cross.T)


def _remark(unknowns: Sequence[Unknown], moved: FloatArray) -> results.Remark:
    """Return the remark on unknowns that are undetermined together. moved: relative change of each."""
    names = tuple(u.name for u in unknowns)
    if len(names) == 1:
        return results.Remark("only_prior" if np.isfinite(unknowns[0].doubt) else "not_shown", names)
    share_a_factor = all(field_of(name) in FIELDS for name in names) and moved.min() > _ALIKE * moved.max()
    return results.Remark("only_ratios" if share_a_factor else "only_together", names)


def errors_by_channel(
    problem: Problem, outputs: Sequence[Mapping[str, FloatArray]]
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return by channel the error (simulated - measured) and the measured values, of samples that count."""
    parts: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for case, out in zip(problem.cases, outputs, strict=True):
        for n in problem.present(case):
            keep, y = case.mask[n], case.measured[n]
            parts.setdefault(n, []).append(((out[n] - y)[keep], y[keep]))
    return {
        n: (np.concatenate([e for e, _ in p]), np.concatenate([y for _, y in p])) for n, p in parts.items()
    }


def parameters_of(solution: Solution, confidence: Confidence) -> tuple[results.ParameterEstimate, ...]:
    """Return the estimates of a fit with their 95 % intervals."""
    sd = np.sqrt(np.diag(confidence.covariance))
    return tuple(
        results.ParameterEstimate(
            name=u.name, value=u.outer(float(theta)),
            unit=in_motion(u.unit, linear=solution.problem.rig.linear),
            ci95=interval(u, float(theta), float(s)), start=u.start, spread=u.spread,
            told_by_data=float(share), spreads_off=u.sigmas(float(theta)),
        )
        for u, theta, s, share in zip(
            solution.problem.unknowns, solution.theta, sd, confidence.data_share, strict=True
        )
    )


def identified_rig(solution: Solution, parameters: Sequence[results.ParameterEstimate]) -> Rig:
    """Return the rig with the fitted values, their intervals, and their doubt as the next fit's spread."""
    rig, clocks = apply(solution.problem.rig, solution.problem.unknowns, solution.theta)
    sensors = {
        n: replace(
            s, clock=s.clock + clocks.offset.get(n, 0.0), clock_rate=s.clock_rate + clocks.rate.get(n, 0.0)
        )
        for n, s in rig.sensors.items()
    }
    intervals = {p.name: p.ci95 for p in parameters}

    def known(quantities: Mapping[str, Quantity], record: str = "") -> dict[str, Quantity]:
        at = {n: n + record for n in quantities}
        return {n: replace(q, ci95=intervals[at[n]], source="identified") if at[n] in intervals else q
                for n, q in quantities.items()}  # fmt: skip

    conditions = tuple(replace(c, values=known(c.values, f"@{c.record}")) for c in rig.conditions)
    return replace(rig, quantities=known(rig.quantities), sensors=sensors, conditions=conditions)


def overlays_of(case: Case, outputs: Mapping[str, FloatArray]) -> tuple[results.Overlay, ...]:
    """Return measured beside simulated for every channel of a case."""
    return tuple(results.Overlay(n, case.t[n], case.measured[n], outputs[n]) for n in outputs)


FAR = 3.0
"""Stated spreads of a value: one right rig in 400 lies further off by chance."""


def is_off_rig(solution: Solution) -> bool:
    """Return whether a fit has taken some value of the rig that far, determined by the data or not."""
    stated = solution.problem.rig.free()
    unknowns = zip(solution.problem.unknowns, solution.theta, strict=True)
    return any(field_of(u.name) in stated and u.sigmas(float(t)) > FAR for u, t in unknowns)


def off_rig(parameters: Iterable[results.ParameterEstimate]) -> tuple[results.Remark, ...]:
    """Return a remark for each value that is surely not the rig's: far off, and determined by the data.

    Beside a misfit it has no interval, NaN.
    """
    off = (p for p in parameters if abs(p.spreads_off) > FAR and p.told_by_data >= results.IDENTIFIABLE_SHARE)
    told = ((p, (math.nan, math.nan) if p.beside_misfit else p.ci95) for p in off)
    return tuple(
        results.Remark("off_rig", (p.name,), (p.start, p.value, *ci95, p.spreads_off), p.unit)
        for p, ci95 in told if not p.name.startswith(results.CLOCKS)
    )  # fmt: skip
