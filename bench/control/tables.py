"""The torque controller on the simulated bench, faster than real time: its tables, as Markdown.

Run: python -m bench control [SECTION …] [RIG] [--free RIG] [--rate 280 1000].
Sections: trials (all requirements, the worst of the set beside the nominal; the whole set swept, and 5 Hz
simulated on all of its corners), free (a free load, unknown, by frequency and amplitude, without
and with an encoder on the link), impedance (the outer loop), link (the benefit of that encoder), late
(samples with irregular arrival), baselines (docs/baselines.md), cost. Through real nodes: `nodes`.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Annotated, Any

import numpy as np

from bench.control.baselines import baselines
from bench.control.human import Virtual, measure_impedance, passive_to, stiffest
from rsea_ros.cli.control import motors
from rsea_ros.control.controller import Measurement, TorqueController, TorqueLimits
from rsea_ros.control.following import ControlTrace, reading
from rsea_ros.control.grid import Grid, Lateness
from rsea_ros.control.link import LinkShare, link_share, linked_set
from rsea_ros.control.margins import distal_responses
from rsea_ros.control.robustness import largest, robustness
from rsea_ros.control.study import LEARNED, sine, study, tracking_error
from rsea_ros.control.synthesis import ControllerDesign, design
from rsea_ros.control.uncertainty import LOCKED, BenchVariant, Uncertainty, corners, load_range, lock
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import Plant
from rsea_ros.records.record import FloatArray
from rsea_ros.report import control as tables

DAMPED = (33.0, 0.3, 1.0)
"""Hz, damping ratio, participation: the other reading of a mode of 0.3."""
SWEEP = np.array([0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 45.0])


PARTS = 10
"""Of a period, between which the simulation distinguishes instants."""
LONG_AGO = 10**12
"""ns, stamp of the first measurement."""


@dataclass(frozen=True)
class Arrivals:
    """When measurements are taken and commands act, of n samples, in periods.

    taken: by how much each measurement is taken after its place; nan for one that is lost. acting: by how
    much the resulting command acts after its sample. ft_age: by how much its
    torque is older than the rest of it. Each of shape (n,); ft_age may be one number.
    """

    taken: FloatArray
    acting: FloatArray
    ft_age: FloatArray | float = 0.0


def irregular(
    rig: Rig,
    rate: float,
    controller: TorqueController,
    desired: FloatArray,
    arrivals: Arrivals,
) -> ControlTrace:
    """Run a controller on a simulated rig with measurements and commands that come when they come.

    As the node does it: a grid gives each stamp its place, lateness fades the feedback. Held to a part
    PARTS of a period.
    """
    plant, grid, lateness = Plant(rig, rate * PARTS), Grid(1e9 / rate), Lateness(rate)
    due = {round((k + off) * PARTS): k for k, off in enumerate(arrivals.taken) if np.isfinite(off)}
    acting: dict[int, float] = {}
    ages = np.broadcast_to(arrivals.ft_age, len(desired))
    rows, torque, command, numbers = [], 0.0, 0.0, np.arange(len(desired))
    sample = plant.step(0.0)
    torques = [sample.ft]
    controller.start(reading(sample), float(desired[0]))
    for part in range(len(desired) * PARTS):
        if part in due:
            periods = grid.place(round(part / PARTS / rate * 1e9 + LONG_AGO))
            late = float(arrivals.acting[due[part]])
            trust = lateness.take(max(late, periods - 1), max(1, periods))
            if periods:
                wanted = float(np.interp((grid.at - LONG_AGO) * 1e-9 * rate, numbers, desired))
                back = min(round(ages[due[part]] * PARTS), part)
                read = replace(reading(sample), ft=torques[part - back], ft_age=back / PARTS)
                command = controller.step(read, wanted, periods - 1, trust=trust, offset=grid.offset)
                acting[part + round((1.0 + late) * PARTS)] = command
        if part % PARTS == 0:
            rows.append((sample.ft, command, sample.velocity))
        torque = acting.pop(part, torque)
        sample = plant.step(torque)
        torques.append(sample.ft)
    n = np.array(rows)
    return ControlTrace(np.arange(len(n)) / rate, np.asarray(desired), n[:, 0], n[:, 1], n[:, 2])


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def trials(rig: Rig, free: Rig, rates: Sequence[float]) -> Iterator[str]:
    """Design, run all trials, sweep the set densely."""
    designed = study(rig, free, rates, motors(rig))
    shown = [f"{at.design.rate:g} Hz" for at in designed.rates]
    yield "\n".join(tables.gains_words(designed))
    for at in designed.rates:
        for u in (Uncertainty(), Uncertainty(mode=DAMPED)):
            swept = robustness(designed.rig, load_range(rig, free), at.design, u=u)
            m = swept.margins
            yield (
                f"{at.design.rate:g} Hz, mode {u.mode}, {swept.cases} benches, {swept.unstable} unstable: "
                f"least phase margin {m.phase:.1f} deg, gain {m.gain:.1f} dB, delay {m.delay:.2f} samples, "
                f"|S| {swept.sensitivity:.2f} ({swept.where})"
            )
        yield from follow_sine(rig, free, at.design)
    yield markdown(["trial", "required", *shown], tables.trial_rows(designed))
    yield markdown(["compensated", "sine of 10 N·m", *shown], tables.compensation_rows(designed))
    yield markdown(
        ["motor", "amplitude", "clamped: up to", "free: up to"], tables.reach_rows(designed)
    )


def follow_sine(rig: Rig, free: Rig, designed: ControllerDesign) -> Iterator[str]:
    """Follow the sine on the rig with each load and on every corner of the set: the worst of each load."""
    loads = load_range(rig, free)
    cases = corners(tuple(loads), Uncertainty())
    _followed.update(rig=loads[LOCKED], loads=loads, design=designed)
    with ProcessPoolExecutor(2, get_context("fork")) as pool:
        errors = list(pool.map(_follow, cases, chunksize=4))
    for load in loads:
        each = {case: error for case, error in zip(cases, errors, strict=True) if case.load == load}
        worst = max(each, key=lambda case: each[case])
        yield (
            f"{designed.rate:g} Hz, 5 Hz followed, {load}: {100.0 * each[BenchVariant(load)]:.2f} %, "
            f"worst of {len(each)} corners {100.0 * each[worst]:.2f} % ({worst})"
        )


_followed: dict[str, Any] = {}
"""rig, loads and design of the sines: processes inherit them, since a rig cannot be pickled."""


def _follow(case: BenchVariant) -> float:
    return tracking_error(case=case, **_followed)


def unknown(rig: Rig, free: Rig, rates: Sequence[float]) -> Iterator[str]:
    """Follow sines on the free load, which the controller does not know, at what the motor can do there."""
    loads = load_range(rig, free)
    for designed in designs(rig, loads, rates):
        share = link_share(rig, loads, designed)
        for hz in (1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0):
            most = min(10.0, 0.8 * largest(free, hz, TorqueLimits().torque, math.inf))
            errors = [
                sine(free, lock(rig), designed, part * most, hz, span=LEARNED, link=link)
                for link in (None, share)
                for part in (1.0, 0.3)
            ]
            cells = ", ".join(f"{100.0 * error:.1f}" for error in errors)
            label = f"{designed.rate:g} Hz, {hz:g} Hz, {most:.1f} N·m"
            yield f"{label}: error {cells} % (all, 0.3 of it; with link)"


def with_link(rig: Rig, free: Rig, rates: Sequence[float]) -> Iterator[str]:
    """Print the output impedance without and with an encoder on the link."""
    loads = load_range(rig, free)
    for designed in designs(rig, loads, rates):
        share = link_share(rig, loads, designed)
        yield f"{designed.rate:g} Hz: {share}"
        spring = np.abs(distal_responses(rig, designed.rate, SWEEP).spring)
        benches = linked_set(rig, loads, designed)
        for name, link in (("without", LinkShare()), ("with", share)):
            over = np.abs(measure_impedance(rig, designed, Virtual(0.0, 0.0), SWEEP, link)) / spring
            cells = [f"{f:g} Hz {r:.2f}" for f, r in zip(SWEEP, over, strict=True)]
            most = benches.sensitivity(link).max()
            yield f"{name}: |Z| over the spring's {', '.join(cells)}; largest |S| of the set {most:.2f}"


def outer(rig: Rig, free: Rig, rates: Sequence[float]) -> Iterator[str]:
    """State the passive range of the outer loop, and measure it with a human-like load."""
    for designed in designs(rig, load_range(rig, free), rates):
        for damping in (0.0, 2.0, 5.0):
            most = stiffest(rig, designed, damping, 20.0)
            to = passive_to(rig, designed, Virtual(0.9 * most, damping))
            yield (
                f"{designed.rate:g} Hz, D_v {damping:g}: Re Z > 0 to 20 Hz for K_v <= {most:.0f} N·m/rad; "
                f"0.9 of that to {to:.0f} Hz"
            )
        for virtual in (Virtual(0.0, 0.0), Virtual(200.0, 2.0)):
            z = measure_impedance(rig, designed, virtual, SWEEP)
            over = np.abs(z) / np.abs(distal_responses(rig, designed.rate, SWEEP).spring)
            cells = [f"{f:g} Hz {r:.2f}" for f, r in zip(SWEEP, over, strict=True)]
            yield f"{virtual}: |Z| over the spring's {', '.join(cells)}; least Re Z {z.real.min():.1f}"


def late(rig: Rig, free: Rig, rates: Sequence[float]) -> Iterator[str]:
    """Let measurements and commands arrive irregularly: largest |ft| and command for 10 N m at 5 Hz."""
    for designed in designs(rig, load_range(rig, free), rates):
        for name, (taken, acting) in _kinds(round(3.0 * designed.rate)).items():
            wanted = 10.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(len(taken)) / designed.rate)
            controller = TorqueController(rig, designed.rate, designed.gains)
            run = irregular(rig, designed.rate, controller, wanted, Arrivals(taken, acting))
            after = run.t > 1.0
            ft, command = np.abs(run.ft[after]).max(), np.abs(run.command[after]).max()
            error = f"error {run.error(1.0):.1%}"
            yield f"{designed.rate:g} Hz, {name}: |ft| {ft:.1f}, command {command:.1f} N·m, {error}"


def _kinds(n: int) -> Mapping[str, tuple[np.ndarray, np.ndarray]]:
    dice, k, none = np.random.default_rng(1), np.arange(n) % 97, np.zeros(n)
    return {
        "in time": (none, none),
        "one 2.6 periods after the last, then one in time": (np.where(k == 60, 1.6, 0.0), none),
        "one lost, the next 0.6 late": (np.select([k == 59, k == 60], [np.nan, 0.6], 0.0), none),
        "a tenth lost": (np.where(dice.random(n) < 0.1, np.nan, 0.0), none),
        "eight lost at once": (np.where((k > 50) & (k < 59), np.nan, 0.0), none),
        "jitter of 0.3 periods": (np.minimum(0.3 * np.abs(dice.normal(size=n)), 0.9), none),
        "all commands one late": (none, none + 1.0),
        "all commands three late": (none, none + 3.0),
    }


def cost(rig: Rig, free: Rig, rates: Sequence[float]) -> Iterator[str]:
    """Print the time of a step as a share of its period; medians of 1000."""
    for designed in designs(rig, load_range(rig, free), rates):
        controller, times = TorqueController(rig, designed.rate, designed.gains), []
        for k in range(1000):
            reading = Measurement(math.sin(0.1 * k), 0.01 * math.cos(0.1 * k), 0.0, 1.0)
            begin = time.perf_counter()
            controller.step(reading, math.sin(0.1 * k))
            times.append(time.perf_counter() - begin)
        middle = statistics.median(times)
        part = f"{100 * middle * designed.rate:.1f} % of the period"
        yield f"{designed.rate:g} Hz: {1e6 * middle:.0f} µs a step, {part}"


def designs(rig: Rig, loads: Mapping[str, Rig], rates: Sequence[float]) -> list[ControllerDesign]:
    """Return the design at each rate."""
    return [design(rig, loads, rate) for rate in rates]


SECTIONS: dict[str, Callable[[Rig, Rig, Sequence[float]], Iterator[str]]] = {
    "trials": trials, "free": unknown, "impedance": outer, "link": with_link,
    "late": late, "baselines": baselines, "cost": cost,
}  # fmt: skip


def main(
    sections: Annotated[tuple[str, ...], SECTIONS] = (), *, rig: str = "paper_high_impedance",
    free: str = "paper_moving_output", rate: tuple[float, ...] = (280.0, 1000.0),
) -> None:  # fmt: skip
    """Run the requested sections.

    free: rig whose ends are the lightest load
    rate: Hz
    """
    for name in sections or SECTIONS:
        print(f"== {name}", flush=True)
        for line in SECTIONS[name](load_rig(rig), load_rig(free), rate):
            print(line, flush=True)
