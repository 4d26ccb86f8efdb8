"""The torque controller on the simulated bench, faster than real time: its tables, as Markdown.

Run: python -m bench control [SECTION …] [RIG] [--free RIG] [--rate 280 1000].
Sections: trials (the whole set swept, and 5 Hz simulated on all of its corners; the requirements, nominal and
worst: `rsea control`), free (a free load, unknown, by frequency and amplitude, without
and with an encoder on the link), impedance (the outer loop), link (the benefit of that encoder), users
(docs/baselines.md). Through real nodes: `driver controller`.
"""

import math
from collections.abc import Callable, Iterator
from typing import Annotated

import numpy as np

from bench.control.human import Virtual, measure_impedance, passive_to, stiffest
from bench.control.users import users
from bench.results import Row
from rsea_ros.control.link import LinkShare, link_share, linked_set
from rsea_ros.control.margins import distal_responses
from rsea_ros.control.robustness import largest, robustness
from rsea_ros.control.study import LEARNED, sine, tracking_error
from rsea_ros.control.synthesis import ControllerDesign, design
from rsea_ros.control.uncertainty import LOCKED, BenchVariant, corners, load_range, lock
from rsea_ros.model.rig import Rig, motor_torque
from rsea_ros.model.rig_file import load_rig

SWEEP = np.array([0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 45.0])


def trials(rig: Rig, free: Rig, rate: float) -> Iterator[str]:
    """Sweep the set densely, and follow the sine with each load on its corners: the worst of each load."""
    loads = load_range(rig, free)
    designed = design(rig, loads, rate)
    yield f"{rate:g} Hz: {designed.gains}"
    swept = robustness(loads[LOCKED], loads, designed)
    m = swept.margins
    yield (f"{rate:g} Hz, {designed.uncertainty}, {swept.cases} benches, {swept.unstable} unstable: "
           f"least phase margin {m.phase:.1f} deg, gain {m.gain:.1f} dB, delay {m.delay:.2f} samples, "
           f"|S| {swept.sensitivity:.2f} ({swept.where})")
    cases = corners(tuple(loads), designed.uncertainty)
    for load in loads:
        mine = (case for case in cases if case.load == load)
        each = {case: tracking_error(loads[LOCKED], loads, case, designed) for case in mine}
        worst = max(each, key=lambda case: each[case])
        yield (f"{rate:g} Hz, 5 Hz followed, {load}: {100.0 * each[BenchVariant(load)]:.2f} %, "
               f"worst of {len(each)} corners {100.0 * each[worst]:.2f} % ({worst})")


def unknown(rig: Rig, free: Rig, rate: float) -> Iterator[str]:
    """Follow sines on the free load, which the controller does not know, at what the motor can do there."""
    loads = load_range(rig, free)
    designed = design(rig, loads, rate)
    share = link_share(rig, loads, designed)
    for hz in (1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0):
        most = min(10.0, 0.8 * largest(free, hz, motor_torque(rig)[0], math.inf))
        errors = [
            sine(free, lock(rig), designed, part * most, hz, span=LEARNED, link=link)
            for link in (None, share)
            for part in (1.0, 0.3)
        ]
        cells = ", ".join(f"{100.0 * error:.1f}" for error in errors)
        yield f"{rate:g} Hz, {hz:g} Hz, {most:.1f} N·m: error {cells} % (all, 0.3 of it; with link)"


def over_spring(rig: Rig, designed: ControllerDesign, z: np.ndarray) -> str:
    """Return |Z| over that of the spring at each frequency of SWEEP."""
    over = np.abs(z) / np.abs(distal_responses(rig, designed.rate, SWEEP).spring)
    cells = [f"{f:g} Hz {r:.2f}" for f, r in zip(SWEEP, over, strict=True)]
    return f"|Z| over the spring's {', '.join(cells)}"


def with_link(rig: Rig, free: Rig, rate: float) -> Iterator[str]:
    """Print the output impedance without and with an encoder on the link."""
    loads = load_range(rig, free)
    designed = design(rig, loads, rate)
    share = link_share(rig, loads, designed)
    yield f"{rate:g} Hz: {share}"
    benches = linked_set(rig, loads, designed)
    for name, link in (("without", LinkShare()), ("with", share)):
        z = measure_impedance(rig, designed, Virtual(0.0, 0.0), SWEEP, link)
        most = benches.sensitivity(link).max()
        yield f"{name}: {over_spring(rig, designed, z)}; largest |S| of the set {most:.2f}"


def outer(rig: Rig, free: Rig, rate: float) -> Iterator[str]:
    """State the passive range of the outer loop, and measure it with a human-like load."""
    designed = design(rig, load_range(rig, free), rate)
    for damping in (0.0, 2.0, 5.0):
        most = stiffest(rig, designed, damping, 20.0)
        to = passive_to(rig, designed, Virtual(0.9 * most, damping))
        yield (f"{rate:g} Hz, D_v {damping:g}: Re Z > 0 to 20 Hz for K_v <= {most:.0f} N·m/rad; "
               f"0.9 of that to {to:.0f} Hz")
    for virtual in (Virtual(0.0, 0.0), Virtual(200.0, 2.0)):
        z = measure_impedance(rig, designed, virtual, SWEEP)
        yield f"{virtual}: {over_spring(rig, designed, z)}; least Re Z {z.real.min():.1f}"


SECTIONS: dict[str, Callable[[Rig, Rig, float], Iterator[Row | str]]] = {
    "trials": trials, "free": unknown, "impedance": outer, "link": with_link, "users": users,
}  # fmt: skip


def main(
    sections: Annotated[tuple[str, ...], SECTIONS] = (), *, rig: str = "paper_high_impedance",
    free: str = "paper_moving_output", rate: tuple[float, ...] = (280.0, 1000.0),
) -> Iterator[Row | str]:  # fmt: skip
    """Run the requested sections.

    free: rig whose ends are the lightest load
    rate: Hz
    """
    for name in sections or SECTIONS:
        yield f"\n{name}"
        for hz in rate:
            yield from SECTIONS[name](load_rig(rig), load_rig(free), hz)
