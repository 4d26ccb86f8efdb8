"""Performance of the health monitor: required and measured values.

alarms  false alarms over hours of clean work of test/independent
faults  each fault switched on after five minutes of work: named, delay, size
node    CPU of the node with its subscriptions, beside plant and excite, while it learns and afterwards
"""

import time
from collections.abc import Iterator

import numpy as np

from bench.health.cases import FAULTS, draw_bench, faulty, monitor_of, pieces, watch
from bench.processes import cpu_time, run_node
from bench.results import Row

CLEAN, WORN = 300.0, 60.0
"""s of work before a fault, with learning (it waits for motion), and after it."""
LEARNED = 220.0
"""s after the start of a joint in motion when learning is over."""
WINDOW = 10.0
"""s over which a share of a core is taken."""


def alarms(
    *, hours: float = 0.5, seeds: tuple[int, ...] = (0, 1, 2), stated: float = 1e-3
) -> Iterator[Row]:
    """Watch clean work of another bench each seed: every finding is a false alarm.

    stated: false alarms an hour, from which the thresholds follow
    """
    for seed in seeds:
        rng = np.random.default_rng([seed, 1])
        bench, rig = draw_bench(rng)
        raised = list(watch(monitor_of(rig, rate=stated), pieces(bench, 3600.0 * hours, rng)))
        told = "; ".join(f"{f.code} {f.name} {f.size:.3g} at {at:.0f} s" for at, f in raised)
        yield Row(f"seed {seed}, {hours:g} h: findings", f"<= {stated * hours:g}", f"{len(raised)}; {told}")


def faults(*, seeds: tuple[int, ...] = (0, 1, 2)) -> Iterator[Row | str]:
    """Switch a fault on after clean work; the last name within a minute counts, and the delay to it."""
    rows: dict[str, list[tuple[bool, float]]] = {name: [] for name in FAULTS}
    fits: list[float] = []
    for seed in seeds:
        for name, fault in FAULTS.items():
            rng = np.random.default_rng([seed, 2])
            bench, rig = draw_bench(rng)
            monitor = monitor_of(rig)
            early = list(watch(monitor, pieces(bench, CLEAN, rng)))
            raised = list(watch(monitor, pieces(faulty(bench, fault), WORN, rng, CLEAN), fits))
            names = [f.code for f in monitor.changes.findings.values()] if monitor.changes else []
            times = [at - CLEAN for at, f in raised if f.code == fault.code]
            right = set(names) == {fault.code}
            told = ", ".join(f"{f.code} {f.name} {f.size:.4g} after {at - CLEAN:.1f} s" for at, f in raised)
            yield f"seed {seed} {name}: {'right' if right else 'WRONG'}; {told or 'nothing'}"
            if early:
                yield f"  false before: {', '.join(f.code for _, f in early)}"
            rows[name].append((right, min(times, default=np.inf)))
    yield f"fits of causes: {len(fits)}, {np.median(fits):.1f} s of a core, the longest {max(fits):.1f} s"
    for name, each in rows.items():
        delays = [delay for _, delay in each]
        told = f"{sum(right for right, _ in each)} of {len(each)}, median {np.median(delays):.1f} s"
        yield Row(f"{name}: named, after", "all", f"{told}, at most {max(delays):.1f} s")


def node(*, rate: float = 280.0, seconds: float = 30.0) -> Iterator[Row]:
    """Measure CPU time of the node with its subscriptions, beside plant and excite."""
    moves = {"kind": "multisine", "low": 0.2, "high": 6.0, "amplitude": 6.0, "duration": seconds + LEARNED}
    with (
        run_node("plant", rate=rate),
        run_node("excite", subscribers=2, rate=rate, **moves),
        run_node("health", out="/nonexistent", bags=0) as health,
    ):
        begun, used = time.monotonic(), [0.0]
        while len(used) * WINDOW <= LEARNED + seconds:
            time.sleep(max(0.0, begun + len(used) * WINDOW - time.monotonic()))
            used.append(cpu_time(health.pid))
    yield Row(f"node, {rate:g} Hz, until {WINDOW:g} s after its start", "", f"{used[1]:.1f} s of a core")
    shares = 100.0 * np.diff(used[1:]) / WINDOW
    learned = round(LEARNED / WINDOW) - 1
    for phase, part in (("while it learns", shares[:learned]), ("afterwards", shares[learned:])):
        told = f"{np.mean(part):.2f} % of a core, at most {np.max(part):.2f} % over {WINDOW:g} s"
        yield Row(f"node, {rate:g} Hz, {phase}", "< 5 % at 280 Hz", told)
