"""Performance of the health monitor: required and measured values.

alarms  false alarms over hours of clean work of test/independent, at several stated rates on the same looks
faults  each fault switched on after five minutes of work: named, delay, size
cost    CPU of the monitor alone, as a share of one core, while it learns and afterwards
node    the same of the node with its subscriptions, beside plant and excite
"""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator, Sequence

import numpy as np

from bench.health.cases import FAULTS, draw_bench, faulty, monitor_of, pieces, watch, work
from bench.processes import cpu_time
from rsea_ros.cli._processes import start, stop
from rsea_ros.health.recursive_estimates import Cusum, threshold
from rsea_ros.model.observer.log import events_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel

EVERY, RATES = 3.0, (100.0, 10.0, 1.0, 1e-3)
CLEAN, WORN = 300.0, 60.0
"""s of work before a fault, with learning (it waits for motion), and after it."""
LEARNED = 220.0
"""s after the start of a joint in motion when learning is over."""
WINDOW = 10.0
"""s over which a share of a core is taken."""


def alarms(*, hours: float = 0.5, seeds: tuple[int, ...] = (0, 1, 2)) -> Iterator[str]:
    """Watch clean work of another bench each seed; the sums run again on its looks at other thresholds."""
    findings, seen = 0, dict.fromkeys(RATES, 0)
    for seed in seeds:
        rng = np.random.default_rng([seed, 1])
        bench, rig = draw_bench(rng)
        with _noted() as rows:
            raised = list(watch(monitor_of(rig), pieces(bench, 3600.0 * hours, rng)))
        findings += len(raised)
        for rate in RATES:
            seen[rate] += _again(rows, rate)
        told = "; ".join(f"{f.code} {f.name} {f.size:.3g} at {at:.0f} s" for at, f in raised)
        yield f"seed {seed}: {hours:g} h, findings: {told or 'none'}"
    total = hours * len(seeds)
    yield f"{total:g} h of work, {findings} false findings at {RATES[-1]:g} an hour"
    for rate, count in seen.items():
        yield f"stated {rate:8g} an hour: sums over their threshold {count / total:.3g} an hour"


class _noted:
    """Note every input of every CUSUM: (inner, outer, score, information, phi)."""

    def __enter__(self) -> list[tuple[Cusum, tuple[np.ndarray, ...]]]:
        rows: list[tuple[Cusum, tuple[np.ndarray, ...]]] = []
        self._take = take = Cusum.take

        def note(cusum: Cusum, *args: np.ndarray) -> bool:
            rows.append((cusum, args))
            return take(cusum, *args)

        Cusum.take = note  # type: ignore[method-assign]
        return rows

    def __exit__(self, *_: object) -> None:
        Cusum.take = self._take  # type: ignore[method-assign]


def _again(rows: list[tuple[Cusum, tuple[np.ndarray, ...]]], rate: float) -> int:
    """Return how often sums of another threshold reach it on the same looks."""
    count, last, sums = 0, None, None
    for given, args in rows:
        if given is not last or sums is None:
            sums, last = given.like(threshold(rate, given.sums.size, EVERY)), given
        if sums.take(*args):
            count += 1
            sums.clear()
    return count


def faults(*, seeds: tuple[int, ...] = (0, 1, 2)) -> Iterator[str]:
    """Switch a fault on after clean work; the last name within a minute counts, and the delay to it."""
    rows: dict[str, list[tuple[bool, float, float, str]]] = {name: [] for name in FAULTS}
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
            sizes = [f.size for _, f in raised if f.code == fault.code]
            right = set(names) == {fault.code}
            told = ", ".join(f"{f.code} {f.name} {f.size:.4g} after {at - CLEAN:.1f} s" for at, f in raised)
            yield f"seed {seed} {name}: {'right' if right else 'WRONG'}; {told or 'nothing'}"
            if early:
                yield f"  false before: {', '.join(f.code for _, f in early)}"
            rows[name].append((right, min(times, default=np.inf), sizes[-1] if sizes else np.nan, told))
    yield f"fits of causes: {len(fits)}, {np.median(fits):.1f} s of a core, the longest {max(fits):.1f} s"
    for name, each in rows.items():
        delays = [delay for _, delay, _, _ in each]
        line = f"{name:22} right {sum(r for r, *_ in each)} of {len(each)}"
        yield f"{line}, delay median {np.median(delays):.1f} s, longest {max(delays):.1f} s"


def cost() -> Iterator[str]:
    """Measure CPU time of the monitor alone over the time of the joint, in windows."""
    for rate in (280.0, 1000.0):
        rig, rng = load_rig("paper_high_impedance"), np.random.default_rng(3)
        t = np.arange(round(LEARNED * 1.5 * rate)) / rate
        events = events_of(synthesize(rig, Channel(t, work(len(t) / rate, rng, rate)), seed=1))
        monitor, step = monitor_of(rig), round(0.75 * rate)
        spent: dict[bool, list[float]] = {True: [], False: []}
        longest, window, begun = 0.0, time.process_time(), 0.0
        for k in range(0, len(events[0]), step):
            before = time.process_time()
            monitor.take(*(part[k : k + step] for part in events))
            now = time.process_time()
            longest = max(longest, now - before)
            if monitor.now >= begun + WINDOW:
                spent[monitor.learning].append((now - window) / (monitor.now - begun))
                window, begun = now, monitor.now
        for learning, shares in spent.items():
            yield f"monitor alone, {rate:g} Hz, {_phase(learning)}: {_shares(shares)}"
        yield f"longest single call, {rate:g} Hz: {1e3 * longest:.0f} ms"


def node(*, rate: float = 280.0, seconds: float = 30.0) -> Iterator[str]:
    """Measure CPU time of the node with its subscriptions, beside plant and excite."""
    used = _node_cpu(rate, seconds)
    yield f"node, {rate:g} Hz, until {WINDOW:g} s after its start: {used[1]:.1f} s of a core"
    shares = np.diff(used[1:]) / WINDOW
    learned = round(LEARNED / WINDOW) - 1
    for learning, part in ((True, shares[:learned]), (False, shares[learned:])):
        yield f"node, {rate:g} Hz, {_phase(learning)}: {_shares(part)} (asked at 280 Hz: < 5)"


def _phase(learning: bool) -> str:
    return "while it learns" if learning else "afterwards"


def _shares(shares: Sequence[float] | np.ndarray) -> str:
    mean, worst = 100.0 * np.mean(shares), 100.0 * np.max(shares)
    return f"{mean:.2f} % of a core, at most {worst:.2f} % over {WINDOW:g} s"


def _node_cpu(rate: float, seconds: float) -> list[float]:
    """Return the CPU time of the node's process after each window, through learning and seconds more, s."""
    def arguments(**values: object) -> list[str]:
        return ["--ros-args", *(w for n, v in values.items() for w in ("-p", f"{n}:={v}"))]

    work = {"kind": "multisine", "low": 0.2, "high": 6.0, "amplitude": 6.0, "duration": seconds + LEARNED + 5}
    excite = arguments(**work, subscribers=2, rate=rate)
    options = {"stdout": -3, "stderr": -3}  # subprocess.DEVNULL
    nodes = [start("plant", arguments(rate=rate), **options), start("excite", excite, **options)]
    health = start("health", arguments(out="/nonexistent", bags=0), **options)
    begun, used = time.monotonic(), [0.0]
    try:
        while len(used) * WINDOW <= LEARNED + seconds:
            time.sleep(max(0.0, begun + len(used) * WINDOW - time.monotonic()))
            used.append(cpu_time(health.pid))
        return used
    finally:
        health.send_signal(signal.SIGINT)
        stop([*nodes, health])
