"""Candidate terms, and what repeats in the residual."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from rsea_ros.diagnosis.initial_guess import interpolate_peak, peaks
from rsea_ros.identification.missing_torque import Place
from rsea_ros.laws import terms
from rsea_ros.laws.variables import CaseModel, ResidualRows, Variables
from rsea_ros.records.record import FloatArray
from rsea_ros.records.statistics import stamped_density

_MOST = 400.0
"""Cycles over the travel at most: more than that no record resolves."""
_TURNS = 2.5
"""As often a wave must have repeated over the travel."""
_BINS = 4096
_LOWEST, _HIGHEST = 1.0, 0.45
"""Hz, and share of the rate, between which lines are looked for."""


def periods(angle: FloatArray, torque: FloatArray, factor: FloatArray | None = None) -> list[float]:
    """Return cycles per radian-turn of the waves that the torque follows best over an angle, at most two.

    angle: rad, of the rotor. factor: what multiplies the waves, such as the deflection of a spring whose
    stiffness repeats; without it, such a wave shows as two lines beside its true one. The torque is averaged
    in bins of the angle, which removes parts that follow time only.
    """
    travel = float(np.ptp(angle))
    if travel <= 0.0:
        return []
    at = np.minimum(((angle - angle.min()) / travel * _BINS).astype(np.int64), _BINS - 1)
    count = np.bincount(at, minlength=_BINS)
    mean = np.bincount(at, torque, _BINS) / np.maximum(count, 1)
    weight = np.sqrt(np.minimum(count, np.median(count[count > 0])))
    x = np.linspace(-1.0, 1.0, _BINS)
    trend = np.polyval(np.polyfit(x, mean, 3, w=weight + 1e-9), x)
    wave = (mean - trend) * weight
    if factor is not None:
        wave *= np.bincount(at, factor, _BINS) / np.maximum(count, 1)
    level = np.abs(np.fft.rfft(wave, 8 * _BINS)) ** 2
    cycles = np.arange(len(level)) / 8.0
    level = np.where((cycles > _TURNS) & (cycles < _MOST), level, 0.0)
    if not level.any():
        return []
    return [interpolate_peak(cycles, level, k) * 2.0 * math.pi / travel for k in peaks(level, apart=16)]


def frequencies(t: FloatArray, residual: FloatArray, length: int, apart: int) -> list[float]:
    """Return the highest peaks of a residual's spectrum over time, Hz, at most two, the highest first.

    length: samples of a segment; of a short one only broad peaks are seen. apart: bins between two.
    """
    rate, bins, level = stamped_density(t, residual, length)
    level = np.where((bins > _LOWEST) & (bins < _HIGHEST * rate), level, 0.0)
    return [interpolate_peak(bins, level, k) for k in peaks(level, apart=apart)]


_DEGREE = 2


@dataclass(frozen=True)
class TermCandidate:
    """One column: a term with a shape, or one part of a spline over a variable (times another).

    part: (variable, factor, number) of a spline's part.
    """

    place: Place
    regressor: str
    term: terms.Term | None = None
    shape: float = 0.0
    part: tuple[str, str, int] | None = None


@dataclass(frozen=True)
class Spline:
    """A spline of any form over one variable, with a number of parts, times a factor."""

    place: Place
    regressor: str
    over: str
    factor: str = ""
    parts: int = 8


SPLINES = (
    Spline("gear", "speed", "w", parts=9),
    Spline("gear", "speed and load", "w", "T", 5),
    Spline("gear", "speed and command", "w", "u", 5),
    Spline("gear", "position", "q", parts=9),
    Spline("gear", "speed and position", "q", "w", 5),
    Spline("gear", "time", "t", parts=5),
    Spline("gear", "speed and time", "t", "w", 5),
    Spline("command", "command", "u", parts=9),
    Spline("command", "command and speed", "w", "u", 5),
    Spline("command", "command and time", "t", "u", 5),
    Spline("motor", "command", "u", parts=9),
    Spline("motor", "command and speed", "w", "u", 5),
    Spline("motor", "command and time", "t", "u", 5),
    Spline("spring", "deflection", "d", parts=9),
    Spline("spring", "deflection and time", "t", "d", 5),
    Spline("ft", "the sensor's torque", "T", parts=7),
    Spline("ft", "time, at the sensor", "t", parts=5),
    Spline("ft", "the sensor's torque and time", "t", "T", 5),
    Spline("encoder", "the load, at the encoder", "T", parts=7),
)


def factor_of(variables: Variables, place: Place, over: str, factor: str) -> FloatArray | float:
    """Return the factor of a spline: loads act on friction by their size, speeds by their sign."""
    if not factor:
        return 1.0
    values = variables.letters[factor]
    if factor == "w":
        return values if over == "t" else np.tanh(values / terms.CREEP)
    return np.abs(values) if place == "gear" else values


def spline_knots(cases: Sequence[CaseModel], spline: Spline) -> FloatArray:
    """Return the knots of a spline, most where the data of all records are, none beyond them."""
    x = np.concatenate([c.variables.letters[spline.over] for c in cases])
    inner = spline.parts - _DEGREE + 1
    low, high = np.quantile(x, [0.001, 0.999])
    even, dense = np.linspace(low, high, inner), np.quantile(x, np.linspace(0.001, 0.999, inner))
    knots = 0.5 * (even + dense)
    knots += 1e-9 * max(float(np.ptp(knots)), 1e-12) * np.arange(inner)
    return np.concatenate([[knots[0]] * _DEGREE, knots, [knots[-1]] * _DEGREE])


def basis_of(x: FloatArray, knots: FloatArray) -> FloatArray:
    """Return the parts of a spline at x, held at their ends beyond the knots, shape (parts, n)."""
    inside = np.clip(x, knots[0], knots[-1])
    return np.ascontiguousarray(BSpline.design_matrix(inside, knots, _DEGREE, extrapolate=True).toarray().T)


def terms_for(cases: Sequence[CaseModel]) -> tuple[terms.Term, ...]:
    """Return the terms that may act on a machine, the waves at the periods that the first record shows."""
    model = cases[0]
    made: list[terms.Term] = [
        *terms.GEAR_TERMS, *terms.COMMAND_TERMS, *terms.MOTOR_TERMS, *terms.SPRING_TERMS, *terms.LOAD_TERMS,
        *terms.SENSOR_TERMS, *terms.ENCODER_TERMS,
    ]  # fmt: skip
    for cycles in wave_numbers(model):
        made += terms.wave_terms(cycles)
    for cycles in wave_numbers(model, "d"):
        made += terms.waves("spring_", "spring", "deflection and position, periodic", "N m/rad", cycles, "d")
    if "ft" in model.places:
        keep = model.case.mask["ft"]
        t, residual = model.case.t["ft"][keep], model.residual["ft"][keep]
        explained = np.interp(t - model.case.start, model.missing.t, model.missing.answers["ft"])
        lines = frequencies(t, residual - explained, len(t), apart=8)[:1]
        made += [term for f in lines for term in terms.hum_terms(f)]
        made += terms.mode_terms(frequencies(t, residual, 1024, apart=12))
    rigid = model.injector is None
    return tuple(
        t for t in made if t.place in model.places and not (rigid and "d" in (t.over, t.expression[:1]))
    )


def wave_numbers(model: CaseModel, factor: str = "") -> list[float]:
    """Return cycles per revolution of the rotor at which the missing torque, over a factor, repeats."""
    variables, missing = model.variables, model.missing
    at = (np.arange(len(variables.letters["t"])) + (0.5 if model.injector else 0.0)) * variables.step
    theta, size = (np.interp(missing.t, at, variables.letters[n]) for n in ("theta", factor or "theta"))
    return periods(theta, missing.torque, size if factor else None)


def candidates_of(cases: Sequence[CaseModel]) -> list[tuple[TermCandidate, list[FloatArray]]]:
    """Return all candidates with their course along the steps of every case."""
    found = []
    for term in terms_for(cases):
        for shape in cases[0].variables.shapes(term):
            values = [c.variables.values(term, shape) for c in cases]
            if any(np.ptp(v) > 0.0 or v[0] != 0.0 for v in values):
                found.append((TermCandidate(term.place, term.regressor, term, shape), values))
    for spline in SPLINES:
        if spline.place not in cases[0].places or np.ptp(cases[0].variables.letters[spline.over]) == 0.0:
            continue
        knots = spline_knots(cases, spline)
        parts = [
            basis_of(v.letters[spline.over], knots) * factor_of(v, spline.place, spline.over, spline.factor)
            for v in (c.variables for c in cases)
        ]
        for k in range(spline.parts):
            part = (spline.over, spline.factor, k)
            found.append((TermCandidate(spline.place, spline.regressor, part=part), [p[k] for p in parts]))
    return found


def columns_of(
    rows: ResidualRows, cases: Sequence[CaseModel], made: Sequence[tuple[TermCandidate, list[FloatArray]]]
) -> list[FloatArray]:
    """Return the column of every candidate; the simulations run on two threads."""

    def column(item: tuple[TermCandidate, list[FloatArray]]) -> FloatArray:
        candidate, values = item
        return rows.column([c.answers(v, candidate.place) for c, v in zip(cases, values, strict=True)])

    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(column, made))
