"""Even stamps from rounded or jittering ones, and records that are steady enough for them.

Scattered stamps read the simulation at wrong instants, and those of commands drive it at wrong instants. That
is more than noise: quick motion seems to need more torque, and a fit finds too much damping (errors in
variables; Fuller, Measurement Error Models, 1987). The values decide whether the stamps or the even clock
behind them are
right: the simulation agrees with one of them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.identification.fit import fit
from rsea_ros.identification.problem import case_from
from rsea_ros.identification.result import Remark
from rsea_ros.identification.solver import Solution
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import BoolArray, Channel, FloatArray, Record

SCATTER = 0.005
"""Of a period, RMS: what scatters less is taken as stamped right."""
_FARTHEST = 0.45
"""Of a period: a stamp further off an even clock could belong to another sample."""
_SURE = 4.0
"""Standard deviations of a period, up to which it may be that of all others: one clock makes them."""
_FALL = 0.8
"""Of the residual at the stamps: the even clock must leave less."""
_NO_WORSE = 1.02
"""Of a sensor's residual: an even clock of the command that raises it by more is not the one that acted."""
_TINY = 1e-30


@dataclass(frozen=True)
class Evened:
    """Records on the even clock where that is right, and the RMS scatter of its stamps, s by channel."""

    records: tuple[Record, ...]
    scatter: Mapping[str, float]

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Return remarks on the changes; empty where no stamps scatter."""
        names = tuple(sorted(self.scatter))
        return (Remark("even_clocks", names, tuple(self.scatter[n] for n in names)),) if names else ()


def even_out(records: Sequence[Record], rig: Rig, solution: Solution) -> Evened:
    """Return the records with an even clock for each channel whose residual under a solution prefers it."""
    if is_inverse(rig):
        return Evened(tuple(records), {})
    scatter: dict[str, float] = {}
    result = []
    for record in records:
        steady, sizes = _on_even_clocks(record)
        chosen = _prefer_even(record, steady, sizes.keys(), rig, solution) if sizes else set()
        scatter |= {n: max(sizes[n], scatter.get(n, 0.0)) for n in chosen}
        result.append(_with_channels_of(record, steady, chosen))
    return Evened(tuple(result), scatter)


def may_be_even(record: Record) -> bool:
    """Return whether the stamps of any channel scatter about an even clock."""
    return bool(_on_even_clocks(record)[1])


def even_clock(t: FloatArray, shared: float = 0.0) -> FloatArray:
    """Return the stamps of an even clock that come nearest to t, s, shape of t; samples may be missing.

    shared: period of all channels, s: used where the stamps do not contradict it, because it is surer.
    Returns t itself where no even clock is near all of it, or where t is already even.
    """
    line = _line(t)
    period = shared if abs(line.period - shared) < _SURE * line.doubt else line.period
    even = period * line.place + float(np.mean(t - period * line.place))
    usual = float(np.median(np.diff(t)))
    if line.farthest > _FARTHEST * usual or line.scatter < SCATTER * usual:
        return t
    return np.asarray(even)


@dataclass(frozen=True)
class _StampFit:
    """Stamps over the number of their sample, by least squares: period and its one sigma, s.

    place: the number of each sample. farthest, scatter: largest and RMS distance of a stamp from it, s.
    """

    place: FloatArray
    period: float
    doubt: float
    farthest: float
    scatter: float


def _line(t: FloatArray) -> _StampFit:
    usual = float(np.median(np.diff(t)))
    place = np.concatenate([[0.0], np.cumsum(np.round(np.diff(t) / usual))])
    period, first = np.polyfit(place, t, 1)
    off = np.abs(t - (first + period * place))
    scatter = float(np.sqrt(np.mean(off**2)))
    doubt = scatter / (float(np.std(place)) * float(np.sqrt(len(place))))
    return _StampFit(place, float(period), doubt, float(off.max()), scatter)


def _shared_period(record: Record) -> float:
    """Return the period, s, of all channels that may have the one of the surest, each by its doubt."""
    lines = [_line(c.t) for n, c in record.channels.items() if n != "reference"]
    best = min(lines, key=lambda line: line.doubt)
    alike = [x for x in lines if abs(x.period - best.period) <= _SURE * np.hypot(x.doubt, best.doubt)]
    return float(np.average([x.period for x in alike], weights=[1.0 / (x.doubt**2 + _TINY) for x in alike]))


def _on_even_clocks(record: Record) -> tuple[Record, dict[str, float]]:
    """Return a record on even clocks, and the RMS scatter of the channels that changed, s."""
    shared = _shared_period(record)
    clocks = {n: even_clock(c.t, shared) for n, c in record.channels.items() if n != "reference"}
    changed = {n: t for n, t in clocks.items() if t is not record[n].t}
    steady = record.with_channels(**{n: Channel(t, record[n].y) for n, t in changed.items()})
    return steady, {n: float(np.std(record[n].t - t)) for n, t in changed.items()}


def _with_channels_of(record: Record, steady: Record, names: Collection[str]) -> Record:
    """Return the record with some channels as they are on even clocks."""
    return record.with_channels(**{n: steady[n] for n in names})


def _prefer_even(
    record: Record, steady: Record, changed: Collection[str], rig: Rig, solution: Solution
) -> set[str]:
    """Return the channels with a smaller residual on the even clock: each sensor, the command by all."""
    sensors = set(changed) - {"command"}
    chosen, stamped = _sensors_preferred(record, steady, sensors, rig, solution)
    if "command" not in changed:
        return chosen
    driven = _with_channels_of(record, steady, ["command"])
    others, even = _sensors_preferred(driven, steady, sensors, rig, solution)
    falls = [even[n] / max(stamped[n], _TINY) for n in stamped.keys() & even.keys() - {"motor_torque"}]
    return {"command", *others} if falls and min(falls) < _FALL and max(falls) < _NO_WORSE else chosen


def _sensors_preferred(
    record: Record, steady: Record, sensors: set[str], rig: Rig, solution: Solution
) -> tuple[set[str], dict[str, float]]:
    """Return the sensors with a smaller residual on the even clock, and the residual of every sensor then."""
    stamped = _residual_rms(record, rig, solution)
    if not sensors:
        return set(), stamped
    even = _residual_rms(_with_channels_of(record, steady, sensors), rig, solution)
    chosen = {n for n in sensors & stamped.keys() & even.keys() if even[n] < _FALL * stamped[n]}
    return chosen, {**stamped, **{n: even[n] for n in chosen}}


def _residual_rms(record: Record, rig: Rig, solution: Solution) -> dict[str, float]:
    """Return by channel the RMS that a solution leaves of a record, means aside."""
    case = case_from(record, rig)
    (outputs,) = replace(solution.problem, cases=(case,)).outputs(solution.theta)
    present = solution.problem.present(case)
    return {n: float(np.std((outputs[n] - case.measured[n])[case.mask[n]])) for n in present}


def with_even_clocks(
    records: Sequence[Record], masked: Sequence[Mapping[str, BoolArray]], rig: Rig
) -> Evened:
    """Return records on the even clocks that a fit of the rig prefers; as they are where no stamps scatter.

    masked: samples that do not count, by channel, of each record.
    """
    steady = Evened(tuple(records), {})
    if is_inverse(rig) or not any(may_be_even(record) for record in records):
        return steady
    while True:
        cases = [case_from(r, rig, bad) for r, bad in zip(steady.records, masked, strict=True)]
        more = even_out(steady.records, rig, fit(cases, rig)[0])
        if not more.scatter:
            return steady
        steady = Evened(more.records, {**steady.scatter, **more.scatter})
