"""The training, validation and test blocks of a record: stretches of time that no two sets share.

Of four blocks two neighbours train, one validates, one tests, in a new random order for every four: with one
order for all, an excitation that repeats after four blocks would show each set the same part of it.
A held-out record, if given, replaces the test blocks.

Effects are screened on a few short pieces of the training blocks, spread over the record: enough to tell
promising effects from hopeless ones.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rsea_ros.diagnosis.settings import DEFAULT, BlockSettings, DiagnosisSettings
from rsea_ros.identification.problem import Case, residual_of
from rsea_ros.model.drive import Drive, SpringStart
from rsea_ros.records.record import BoolArray, FloatArray, IntArray

TRAIN, VALIDATION, TEST = (0, 1), (2,), (3,)
"""Half of the blocks train: fits need data most; validation and tests share the rest."""
_ORDERS = np.array(
    [[0, 1, 2, 3], [0, 1, 3, 2], [2, 0, 1, 3], [3, 0, 1, 2], [2, 3, 0, 1], [3, 2, 0, 1]], dtype=np.int64
)
_PATTERN = _ORDERS[np.random.default_rng(4).integers(0, len(_ORDERS), 997)]
"""Set of each block, four in a row; repeats after more than an hour."""
_ROUNDING = 0.05
"""Of a period: up to this much less than a whole number of samples is one, jitter of the stamps."""


def block_length(case: Case, rule: BlockSettings) -> float:
    """Return the length of a block, s: the longest, or less where a record would have too few of them."""
    return min(max(case.duration / rule.enough, rule.shortest), rule.longest)


def set_of(block: IntArray) -> IntArray:
    """Return the set of each block: a number in TRAIN, VALIDATION or TEST."""
    return np.asarray(_PATTERN[(block // 4) % len(_PATTERN), block % 4])


def train_starts(case: Case, rule: BlockSettings) -> FloatArray:
    """Return the times at which the pairs of training blocks begin, s since the case's start."""
    groups = int(case.duration / block_length(case, rule)) // 4
    firsts = np.argmin(_PATTERN[np.arange(groups) % len(_PATTERN)], axis=1)
    return np.asarray((4 * np.arange(groups) + firsts) * block_length(case, rule))


def blocks_of(case: Case, channel: str, rule: BlockSettings) -> IntArray:
    """Return the number of the block of each sample of a channel."""
    return np.maximum(np.floor((case.t[channel] - case.start) / block_length(case, rule)), 0).astype(np.int64)


def part(case: Case, sets: tuple[int, ...], rule: BlockSettings) -> Case:
    """Return the case with only the samples of some sets."""
    mask: dict[str, BoolArray] = {n: np.isin(set_of(blocks_of(case, n, rule)), sets) for n in case.t}
    return case.within(mask)


_RUN_UP, _ENOUGH = 0.5, 14.0
"""s: simulated and not compared before a piece, in which the measured state decays; data in all pieces."""


def short_pieces_of(
    case: Case, outputs: Mapping[str, FloatArray], settings: DiagnosisSettings = DEFAULT
) -> tuple[Case, ...]:
    """Return pieces of a case, each a run-up and a pair of training blocks, about 14 s of data in all.

    Half are spread evenly; half are where a model's `outputs` are worst, for effects that act rarely.
    A case of a measured motion (inverse model) costs little and is returned whole, and so is one without a
    position: nothing says in which state a piece of it begins.
    """
    blocks = settings.blocks
    fit = part(case, TRAIN, blocks)
    thinner = as_often_as_commands(fit)
    drive = thinner.drive
    if not isinstance(drive, Drive) or drive.duration < 2.0 * _ENOUGH or "position" not in case.measured:
        return (thinner,)
    length = 2.0 * block_length(case, blocks)
    pairs = train_starts(case, blocks)[1:]
    starts = pairs[[_is_covered(drive, t - _RUN_UP, t + length) for t in pairs]]
    half = round(0.5 * _ENOUGH / length)
    spread = np.unique(np.linspace(0, len(starts) - 1, 2 * half + 1).round().astype(int)[1::2])
    misfit = np.array([misfit_between(fit, outputs, float(t), length) for t in starts])
    misfit[spread] = -1.0
    worst = np.argsort(misfit)[len(spread) - 2 * half :]
    chosen = starts[np.sort(np.concatenate([spread, worst]))].tolist()
    pieces = []
    for t in chosen:
        first = run_up_step(drive, t, _RUN_UP)
        start = drive.start + first * drive.step
        begin = state_at(case, start, outputs), spring_at(case, start, outputs)
        pieces.append(_piece(thinner, drive, first, t + length, *begin))
    return tuple(pieces)


def as_often_as_commands(case: Case) -> Case:
    """Return a case with every k-th sample of a channel that has k or more to a command.

    A response to a command shows at the command's rate; more samples add only noise at several times the
    cost. A filter at the samples needs all of them.
    """
    drive = case.drive
    if not isinstance(drive, Drive):
        return case
    period = drive.hold * drive.step
    whole = {n for n, known in case.filters.items() if known.is_sampled}
    every = {n: slice(None, None, 1 if n in whole else _samples_in(period, t)) for n, t in case.t.items()}
    return case.keep(every, replace(drive, at={n: at[every[n]] for n, at in drive.at.items()}))


def _samples_in(period: float, t: FloatArray) -> int:
    """Return how many samples of a channel a period holds, 1 at least."""
    between = float(np.median(np.diff(t))) if len(t) > 1 else period
    return max(1, int(period / max(between, 1e-3 * period) + _ROUNDING))


def _is_covered(drive: Drive, begin: float, end: float) -> bool:
    """Return whether one span of a drive holds all from one time since its start to another, s."""
    spans = [(first * drive.step, last * drive.step) for first, last in drive.spans]
    return not spans or any(first <= begin and end <= last for first, last in spans)


def misfit_between(case: Case, outputs: Mapping[str, FloatArray], begin: float, length: float) -> float:
    """Return the power of a residual in a piece, each channel over its power in all, summed."""
    total = 0.0
    for n in case.measured.keys() & outputs.keys():
        power = residual_of(case, outputs, n) ** 2
        t = case.t[n] - case.start
        inside = (t >= begin) & (t < begin + length)
        total += float(power[inside].sum() / max(power.sum(), 1e-300))
    return total


def run_up_step(drive: Drive, begin: float, run_up: float) -> int:
    """Return the step, the first of a command period, with which the run-up of a time begins, s."""
    return max(0, int((begin - run_up) / drive.step) // drive.hold * drive.hold)


def _piece(
    case: Case, drive: Drive, first: int, end: float, state: tuple[float, float], spring: SpringStart | None
) -> Case:
    """Return the part of a case from a step with a state and a spring to a time since its start, s."""
    last, start = math.ceil(end / drive.step) + 1, drive.start + first * drive.step  # with what follows
    inside = {n: (t >= start) & (t < drive.start + end) for n, t in case.t.items()}
    cut = replace(
        drive, start=start, command=drive.command[first:last],
        at={n: drive.at[n][keep] - first for n, keep in inside.items()},
        reference=drive.reference[first:last], angle=drive.angle[first:last], initial=state, spring=spring,
        origin=drive.origin + first * drive.step, whole=drive.drift_time,
        restarts=tuple((k - first, state) for k, state in drive.restarts if first < k < last), spans=(),
    )
    return case.within({n: t >= start + _RUN_UP for n, t in case.t.items()}).keep(inside, cut)


_NEAR = 0.03
"""s on either side that show a speed: of 4 Hz 10 % is missing, of what a model leaves."""
_FEWEST = 4
"""Samples that it takes at least."""


def state_at(case: Case, t: float, outputs: Mapping[str, FloatArray] | None = None) -> tuple[float, float]:
    """Return position (rad) and velocity (rad/s) at a time, zero where nothing shows them.

    A velocity that is not measured is the slope of a model's position, of `outputs`, and of what that leaves.
    """
    if "position" not in case.measured:
        return 0.0, _at(case, "velocity", t) if "velocity" in case.measured else 0.0
    if "velocity" in case.measured:
        return _at(case, "position", t), _at(case, "velocity", t)
    return _beside(case, "position", t, outputs)


def spring_at(case: Case, t: float, outputs: Mapping[str, FloatArray]) -> SpringStart | None:
    """Return what a sensor of the spring shows at a time, beside a model's outputs; None without a sensor."""
    channel = next((n for n in ("deflection", "ft") if n in case.measured), None)
    return SpringStart(channel, *_beside(case, channel, t, outputs)) if channel else None


def _beside(
    case: Case, channel: str, t: float, outputs: Mapping[str, FloatArray] | None
) -> tuple[float, float]:
    """Return value and rate of a channel at a time: a model's, and a line through what that leaves."""
    stamps, measured = case.t[channel], case.measured[channel]
    simulated = (outputs or {}).get(channel, np.zeros(len(stamps)))
    first, last = np.searchsorted(stamps, (t - _NEAR, t + _NEAR))
    near = slice(max(min(first, last - _FEWEST), 0), max(last, first + _FEWEST))
    off, model = stamps[near] - t, simulated[near]
    if len(off) < _FEWEST:
        return _at(case, channel, t), 0.0
    from scipy.interpolate import CubicSpline  # half a second at every start, which a velocity sensor saves

    slope, level = np.polyfit(off, measured[near] - model, 1)
    curve = CubicSpline(off, model)
    return float(curve(0.0) + level), float(curve(0.0, 1) + slope)


def _at(case: Case, channel: str, t: float) -> float:
    return float(np.interp(t, case.t[channel], case.measured[channel]))
