"""A fit as a value: measurements with their weights, and the simulation compared with them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from rsea_ros.errors import IdentificationError
from rsea_ros.identification.noise import least_noise, noise_floor
from rsea_ros.identification.unknowns import Clocks, Unknown, apply
from rsea_ros.model.drive import Drive, LoadStart, SpringStart, outside_gaps, zero_unknown
from rsea_ros.model.extent import SKIPPED_START
from rsea_ros.model.inverse import Motion, acting_torque, is_inverse, motion_from, noise_along, torques_along
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.rig import Rig, Sensor
from rsea_ros.model.sensor_filter import SensorFilter
from rsea_ros.model.simulation import drive_of, simulate_drives
from rsea_ros.model.step import OUTPUTS
from rsea_ros.records.record import MEASURED, BoolArray, Channel, FloatArray, Record
from rsea_ros.records.statistics import runs_of

FEWEST = 64
"""Samples of a channel: fewer show no spectrum, so no noise to weigh them by."""


@dataclass(frozen=True)
class Case:
    """One record ready to be simulated: drive, measured channels, their noise, and which samples count.

    floating: channels whose zero is unknown; they are compared without their means.
    least: by channel its least noise. coloured: channels whose entire residual was
    taken for noise of the sensor after a fit (noise_level.py). filters: known ones, by channel.
    starts: where states at the start or behind gaps are fitted with each simulation, by channel what a change
    of each does to it, shape (n, k), and which samples tell.
    """

    drive: Drive | Motion
    t: Mapping[str, FloatArray]
    measured: Mapping[str, FloatArray]
    noise: Mapping[str, float]
    mask: Mapping[str, BoolArray]
    source: str = ""
    floating: frozenset[str] = frozenset()
    least: Mapping[str, float] = field(default_factory=dict)
    coloured: frozenset[str] = frozenset()
    starts: Mapping[str, tuple[FloatArray, BoolArray]] = field(default_factory=dict)
    filters: Mapping[str, SensorFilter] = field(default_factory=dict)

    @cached_property
    def told_starts(self) -> tuple[FloatArray, FloatArray]:
        """What `starts` does to the samples that tell, over noise, shape (m, k), and its square, (k, k)."""
        columns = np.concatenate([shows[m] / self.noise[n] for n, (shows, m) in self.starts.items()])
        return columns, columns.T @ columns + _KNOWN * np.eye(columns.shape[1])

    def within(self, mask: Mapping[str, BoolArray]) -> Case:
        """Return the case with only samples that are also in `mask`."""
        return replace(self, mask={n: m & mask[n] for n, m in self.mask.items()})

    def keep(self, samples: Mapping[str, slice | BoolArray], drive: Drive) -> Case:
        """Return the case on another drive, with some samples of each channel."""
        return replace(
            self, drive=drive, t={n: t[samples[n]] for n, t in self.t.items()},
            measured={n: y[samples[n]] for n, y in self.measured.items()},
            mask={n: m[samples[n]] for n, m in self.mask.items()},
            starts={n: (shows[samples[n]], tells[samples[n]]) for n, (shows, tells) in self.starts.items()},
        )

    def with_noise(self, noise: Mapping[str, float]) -> Case:
        """Return the case with the channels of another noise only, weighted by it."""
        channels = [n for n in self.t if n in noise]
        return replace(
            self, t={n: self.t[n] for n in channels}, measured={n: self.measured[n] for n in channels},
            noise={n: noise[n] for n in channels}, mask={n: self.mask[n] for n in channels},
        )

    @property
    def start(self) -> float:
        """Record time at which the case begins, s."""
        return self.drive.start if isinstance(self.drive, Drive) else float(self.drive.t[0])

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        drive = self.drive
        return drive.duration if isinstance(drive, Drive) else float(drive.t[-1] - drive.t[0])


def case_from(
    record: Record,
    rig: Rig,
    masked: Mapping[str, BoolArray] | None = None,
) -> Case:
    """Make a record ready.

    masked: samples by channel that are faulty and must not count.
    Raises IdentificationError when no channel of the record is one that the rig has.
    """
    rig = rig.under(record.source)
    if is_inverse(rig):
        return _inverse_case(_without_long_faults(record, masked or {}), rig)
    record = with_command(record, rig)
    channels = channels_that_tell(record, rig)
    beside = [n for n in record.channels if n not in OUTPUTS]
    record = replace(record, channels={n: record[n] for n in (*beside, *channels)})
    floating = frozenset(n for n in channels if zero_unknown(record, rig, n))
    sensors = {n: rig.sensors.get(n, Sensor()) for n in channels}
    good = {n: ~masked[n] if masked and n in masked else np.ones(len(record[n]), bool) for n in channels}
    start = float(record["command"].t[0]) + SKIPPED_START
    known = {n: outside_gaps(record, record[n].t, SKIPPED_START) for n in channels}
    counts = {n: good[n] & known[n] & np.isfinite(record[n].y) & (record[n].t >= start) for n in channels}
    spans = {n: counted_span(counts[n]) for n in channels}  # noise elsewhere is not the fit's
    heard = record.with_channels(**{n: Channel(record[n].t[s], record[n].y[s]) for n, s in spans.items()})
    return Case(
        drive=drive_of(record, rig),
        t=MappingProxyType({n: record[n].t for n in channels}),
        measured=MappingProxyType({n: record[n].y for n in channels}),
        noise=MappingProxyType({n: noise_floor(heard, n, sensors[n]) for n in channels}),
        mask=MappingProxyType(counts),
        source=record.source,
        floating=floating,
        filters=rig.filters(),
        least=MappingProxyType({n: least_noise(heard[n].y, sensors[n]) for n in channels}),
    )


def counted_span(counts: BoolArray) -> slice:
    """Return the part of a channel from its first sample that counts to its last; all where none does."""
    at = np.flatnonzero(counts)
    return slice(int(at[0]), int(at[-1]) + 1) if len(at) else slice(0, len(counts))


def channels_that_tell(record: Record, rig: Rig) -> list[str]:
    """Return the channels to be simulated: those of the rig that have samples enough and are not still.

    A sensor that holds one value throughout is dead or unplugged: it has no noise to weigh it by.
    Raises IdentificationError when none of them shows the motion.
    """
    channels = [n for n in OUTPUTS if n in record and rig.measures(n)]
    if not set(channels) - {"motor_torque"}:
        raise IdentificationError(
            f"{record.source}: no ft, deflection, position or velocity channel for rig {rig.name}, "
            f"expected one: record it, or {record.naming}"
        )
    start = float(record["command"].t[0]) + SKIPPED_START
    counts = {n: int(np.sum((record[n].t >= start) & np.isfinite(record[n].y))) for n in channels}
    alive = [n for n in channels if counts[n] >= FEWEST and not record[n].is_still]
    if set(alive) - {"motor_torque"}:
        return alive
    have = "; ".join(
        f"{n} {'holds one value' if record[n].is_still else f'has {counts[n]} samples'}" for n in channels
    )
    raise IdentificationError(
        f"{record.source}: {have}; expected ft, deflection, position or velocity with motion in it and "
        f"{FEWEST} samples or more later than {SKIPPED_START:g} s after the first command"
    )


def _inverse_case(record: Record, rig: Rig) -> Case:
    """Make a record that is judged along its measured motion ready: its torques against those that it takes.

    Noise: what passes the filter of the noise of all that was measured. A command has none.
    """
    motion, torque = motion_from(record, rig), acting_torque(record)
    for name, channel in (("position", record["position"]), ("the torque that acted", torque)):
        if channel.is_still:
            raise IdentificationError(
                f"{record.source}: {name} holds one value, expected motion: "
                "a rig without a spring is judged by what moves it"
            )
    sensors = {n: rig.sensors.get(n, Sensor()) for n in MEASURED if n in record}
    motion = motion.with_noise(rig, {n: noise_floor(record, n, sensor) for n, sensor in sensors.items()})
    judged = motion.judged
    return with_noise_along(rig, Case(
        drive=motion, t=dict.fromkeys(judged, motion.t), measured=judged, noise={},
        mask=dict.fromkeys(judged, motion.counts), source=record.source,
        floating=frozenset([*judged][-1:] if len(motion.d) and rig.zero_unknown("deflection") else ()),
    ))  # fmt: skip


def with_noise_along(rig: Rig, case: Case) -> Case:
    """Return a case with the noise that a rig's inertia, damping and stiffness make of what was measured.

    Only where torques are judged along a motion: elsewhere noise is the sensor's own.
    """
    if not isinstance(case.drive, Motion):
        return case
    least = {n: max(_ROUNDING * float(np.std(y)), 1e-300) for n, y in case.measured.items()}
    found = noise_along(rig.under(case.source), case.drive)
    return replace(case, noise={n: max(sigma, least[n]) for n, sigma in found.items()})


_ROUNDING = 1e-6
"""Of a torque's standard deviation."""


def _without_long_faults(record: Record, masked: Mapping[str, BoolArray]) -> Record:
    """Return a record without runs of faulty samples: what is bridged is no data, and a filter spreads it."""
    kept = {}
    for n, bad in ((n, bad) for n, bad in masked.items() if n in MEASURED and len(bad) == len(record[n])):
        keep = np.ones(len(bad), bool)
        for begin, end in runs_of(bad):
            keep[begin:end] = end - begin < _LONG
        kept[n] = Channel(record[n].t[keep], record[n].y[keep])
    return record.with_channels(**{n: c for n, c in kept.items() if len(c) >= FEWEST})


_LONG = 5
"""Samples in a row."""


def simulate_cases(
    cases: Sequence[Case], rig: Rig, *clocks: Clocks, on_angle: bool = False
) -> list[list[dict[str, FloatArray]]]:
    """Return for each of some clocks the channels of cases, simulated once and read as the clocks have it.

    Each on the rig as it was for its record. A channel whose zero is unknown comes with the measured mean.
    """
    conditions = [rig.condition(c.source) for c in cases]
    names = [differs.record if differs else "" for differs in conditions]
    rigs = {name: rig.under(name) for name in names}
    simulations = {}
    for name, own in rigs.items():
        alike = [c.drive for c, n in zip(cases, names, strict=True) if n == name]
        drives = [drive for drive in alike if isinstance(drive, Drive)]
        at = [[_instants(drive, one) for one in clocks] for drive in drives]
        simulations[name] = iter(simulate_drives(own, drives, at, on_angle=on_angle))
    by_case = [
        [_on_measured_zero(c, torques_along(rigs[name], c.drive))] * len(clocks)
        if isinstance(c.drive, Motion)
        else [_from_fitted_starts(c, _on_measured_zero(c, outputs)) for outputs in next(simulations[name])]
        for c, name in zip(cases, names, strict=True)
    ]
    return [[outputs[k] for outputs in by_case] for k in range(len(clocks))]


def _on_measured_zero(case: Case, outputs: dict[str, FloatArray]) -> dict[str, FloatArray]:
    for n in case.floating:
        keep = case.mask[n]
        outputs[n] = outputs[n] + float(np.mean((case.measured[n] - outputs[n])[keep]))
    return outputs


def _from_fitted_starts(case: Case, outputs: dict[str, FloatArray]) -> dict[str, FloatArray]:
    if not case.starts:
        return outputs
    change = change_of_starts(case, outputs)
    return outputs | {n: outputs[n] + shows @ change for n, (shows, _) in case.starts.items()}


def change_of_starts(case: Case, outputs: Mapping[str, FloatArray]) -> FloatArray:
    """Return the changes of `starts` with which outputs fit best, shape (k,); zero where they ran away."""
    columns, square = case.told_starts
    off = ((case.measured[n] - outputs[n])[m] / case.noise[n] for n, (_, m) in case.starts.items())
    left = np.concatenate([*off])
    if not (np.isfinite(left).all() and np.isfinite(square).all()):
        return np.zeros(len(square))
    return np.asarray(np.linalg.solve(square, columns.T @ left))


_KNOWN = 1e-6
"""What the sensors say of a state at a start is trusted to 1000 times its noise."""


def _instants(drive: Drive, clocks: Clocks) -> Mapping[str, FloatArray]:
    """Return when the channels of a drive are read by some clocks, in steps since its start."""
    if clocks.are_right:
        return drive.at
    return {
        n: at + clocks.later(n, drive.origin + drive.step * at if n in clocks.rate else 0.0) / drive.step
        for n, at in drive.at.items()
    }


def residual_of(case: Case, outputs: Mapping[str, FloatArray], channel: str) -> FloatArray:
    """Return measured - simulated, 0 where a sample does not count, shape of the channel."""
    return np.where(case.mask[channel], case.measured[channel] - outputs[channel], 0.0)


def weighted_residual(case: Case, outputs: Mapping[str, FloatArray], channels: Sequence[str]) -> FloatArray:
    """Return (simulated - measured) / noise of the samples that count, channel after channel.

    A simulation that runs away gives infinities, which a fit turns back from.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        parts = [((outputs[n] - case.measured[n]) / case.noise[n])[case.mask[n]] for n in channels]
        return np.concatenate(parts)


def with_unknown_start(problem: Problem, theta: FloatArray) -> Problem:
    """Return a problem that fits the state at the start of each case with each simulation.

    To first order, about the motion at theta: position, speed, and the spring as its sensor shows it.
    """
    rig, clocks = apply(problem.rig, problem.unknowns, theta)
    cases = list(problem.cases)
    for i, case in enumerate(cases):
        if isinstance(case.drive, Drive):
            _, shown = shown_by_starts(case, [*_other_starts(case.drive, case.noise)], rig, clocks, problem)
            told = _directions(np.concatenate([y[case.mask[n]] / case.noise[n] for n, y in shown.items()]))
            cases[i] = replace(case, starts={n: (y @ told, case.mask[n]) for n, y in shown.items()})
    return replace(problem, cases=tuple(cases))


def _directions(columns: FloatArray) -> FloatArray:
    """Return sums of changes, shape (k, sums), that do different things to a residual, each as much."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(np.isfinite(size) & (size > 0.0), size, np.inf)
    _, shares, sums = np.linalg.svd(np.nan_to_num(columns / size), full_matrices=False)
    is_told = shares > _SAME
    return np.asarray((sums[is_told] / size).T / shares[is_told] / _KNOWN**0.5)


def shown_by_starts(
    case: Case, drives: Sequence[Drive], rig: Rig, clocks: Clocks, problem: Problem
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Return by channel the outputs of a case, shape (n,), and what other drives add, shape (n, drives)."""
    moved = [replace(case, drive=drive, starts={}) for drive in (case.drive, *drives)]
    own, *others = simulate_cases(moved, rig, clocks, on_angle=problem.on_angle)[0]
    return own, {n: np.stack([o[n] - own[n] for o in others], axis=1) for n in problem.present(case)}


_SAME = 1e-3
"""Share of the largest below which two states at the start do the same to the residual."""


def _other_starts(drive: Drive, noise: Mapping[str, float]) -> Iterator[Drive]:
    """Yield a drive from states, at its start and behind gaps, off by what its sensors' noise shows."""
    for motion, spring in _near(drive.initial, drive.spring, noise):
        yield replace(drive, initial=motion, spring=spring)
    moving = [(i, k, state) for i, (k, state) in enumerate(drive.restarts) if isinstance(state, LoadStart)]
    for i, k, state in moving:
        for motion, spring in _near((state.position, state.velocity), state.spring, noise):
            anew = k, LoadStart(*motion, spring or state.spring)
            yield replace(drive, restarts=(*drive.restarts[:i], anew, *drive.restarts[i + 1 :]))


def _near(
    motion: tuple[float, float], spring: SpringStart | None, noise: Mapping[str, float]
) -> Iterator[tuple[tuple[float, float], SpringStart | None]]:
    (q, w), off = motion, noise.get("position", OFF)
    yield (q + off, w), spring
    yield (q, w + off / APART), spring
    if spring is not None:
        off = noise.get(spring.channel, OFF)
        yield motion, spring._replace(value=spring.value + off)
        yield motion, spring._replace(rate=spring.rate + off / APART)


OFF = 1e-4
"""rad, where the position is not measured."""
APART = 0.03
"""s, over which a rate is known to the noise of its sensor."""


@dataclass(frozen=True)
class Problem:
    """Records, the rig, and the unknowns. channels: of the residual.

    on_angle: effects of the rotor's angle act along the measured one.
    stated: names of the effects that belong to the nominal rig; a search adds others beside them.
    newest: name of the effect that the search added last; empty for none.
    """

    cases: tuple[Case, ...]
    rig: Rig
    unknowns: tuple[Unknown, ...]
    channels: tuple[str, ...]
    on_angle: bool = False
    stated: frozenset[str] = frozenset()
    newest: str = ""

    @property
    def acting(self) -> tuple[str, ...]:
        """Return the names of all effects of the rig."""
        return tuple(e.name for e in self.rig.effects)

    @property
    def added(self) -> tuple[str, ...]:
        """Return the names of the effects that a search has added, in the order in which it did."""
        return tuple(name for name in self.acting if name not in self.stated)

    def outputs(self, theta: FloatArray) -> list[dict[str, FloatArray]]:
        """Return the simulated channels of every case at theta."""
        rig, clocks = apply(self.rig, self.unknowns, theta)
        return simulate_cases(self.cases, rig, clocks, on_angle=self.on_angle)[0]

    def residual_of(self, outputs: Sequence[Mapping[str, FloatArray]]) -> FloatArray:
        """Return the weighted residuals of all cases, shape (m,)."""
        parts = [weighted_residual(c, o, self.present(c)) for c, o in zip(self.cases, outputs, strict=True)]
        return np.concatenate(parts)

    def residual(self, theta: FloatArray) -> FloatArray:
        """Return the weighted residuals at theta, shape (m,)."""
        return self.residual_of(self.outputs(theta))

    def by_row(self, number: Callable[[Case, str], float]) -> FloatArray:
        """Return a number that belongs to each case and channel for every residual, shape (m,)."""
        rows = ((case, n) for case in self.cases for n in self.present(case))
        return np.concatenate([np.full(np.count_nonzero(case.mask[n]), number(case, n)) for case, n in rows])

    def since_start(self) -> FloatArray:
        """Return for every residual the time since the start of its record, s, shape (m,)."""
        begins = [case.drive.origin if isinstance(case.drive, Drive) else 0.0 for case in self.cases]
        cases = zip(self.cases, begins, strict=True)
        return np.concatenate([c.t[n][c.mask[n]] - c.start + at for c, at in cases for n in self.present(c)])

    def present(self, case: Case) -> list[str]:
        """Return the channels of a case that count, in a fixed order."""
        return [n for n in self.channels if n in case.measured]
