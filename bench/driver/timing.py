"""Cycles, latency and CPU of the driver node, beside a bare loop with absolute deadlines meanwhile.

Each rate as any process, then at SCHED_FIFO where that is permitted: driver and bare loop at the same
priority, the simulated bench one above, since hardware does not wait for our processor. After each, for half
as long, a minute at most, and beside another bare loop: a loop of nothing but the two requests to the motor.
Its lateness is that of pseudo-terminal and bench: the kernel passes the bytes on in a worker of usual
priority. A driver is late less often only where it does not wait for a reply.
"""

from pathlib import Path

import numpy as np

from bench.driver.bare_loop import BareLoop
from bench.driver.reception import beside_bare_loop
from bench.processes import hurried_wire, may_have, own_domain, run_node
from msg_adapters.ros import JointState
from rsea_ros.hardware.peer.remote import RemoteBench
from rsea_ros.nodes._qos import MEASUREMENT
from rsea_ros.records.record import FloatArray

Row = tuple[str, str, str]
LATE = 0.3
"""ms more than a period are a late cycle."""


def timing(
    folder: Path, *, rate: tuple[float, ...] = (280.0, 1000.0), priority: tuple[int, ...] = (0, 80),
    seconds: float = 30.0, can: str = "",
) -> list[Row]:  # fmt: skip
    """Measure each rate with each priority. can: with this drive on CAN, in place of a Dynamixel."""
    own_domain()
    rows: list[Row] = []
    for hz in rate:
        for fifo in filter(may_have, priority):
            place = folder / f"{hz:g}_{fifo}"
            place.mkdir()
            rows += _at(hz, seconds, fifo, place, can)
    return rows


def _at(rate: float, seconds: float, priority: int, folder: Path, can: str) -> list[Row]:
    patient = {"lost_cycles": 100, "ft_timeout": 1.0, "command_timeout": 10.0}
    patient |= {"autostart": True, "resume": True}
    drive = ("--can", can) if can else ()
    with RemoteBench(folder / "tty", *drive) as bench, hurried_wire(priority and priority - 1):
        if priority:
            bench.hurry(priority + 1)
        baud = 1_000_000 if can else 4_000_000
        patient |= {"rate": rate, "baud": baud, "realtime_priority": priority, **bench.parameters()}
        with run_node("driver", folder=folder, noted=True, **patient) as node:
            topics = {"joint_states": (JointState, MEASUREMENT)}
            delays, alone, cpu = beside_bare_loop(node.pid, topics, rate, seconds, folder, priority)
        times = np.load(folder / "driver.npy")
        times = times[(times[:, 1] > alone[0, 1]) & (times[:, 1] < alone[-1, 1])]
        alone_for = min(0.5 * seconds, 60.0)
        floor = "not on CAN" if can else _wire_alone(rate, alone_for, priority, folder, bench)
    setup = f"{rate:g} Hz, {seconds:g} s" + (f", FIFO {priority}" if priority else "")
    return [
        *_cycles(setup, rate, times[:, :2], alone),
        *_latencies(setup, times[:, 2:], delays["joint_states"]),
        (f"{setup}: late cycles of the two requests alone, {alone_for:g} s", "", floor),
        (f"{setup}: CPU of the driver", "< 20 % at 280 Hz", f"{100 * cpu:.1f} %"),
    ]


def _wire_alone(rate: float, seconds: float, priority: int, folder: Path, bench: RemoteBench) -> str:
    """Return how many cycles are late that only ask the motor, and those of the bare loop beside it."""
    wire = BareLoop(rate, seconds, folder, priority, bench.port)
    bare = BareLoop(rate, seconds, folder, priority)
    late, late_alone = (_late(loop.cycles()[:, 1], rate) for loop in (wire, bare))
    return f"{late} of {int(rate * seconds)}, bare {late_alone}, ratio {late / max(1, late_alone):.2f}"


def _late(begun: np.ndarray, rate: float) -> int:
    """Count the cycles that begin more than LATE after a period; begun: ns."""
    return int((np.diff(begun) / 1e6 > 1e3 / rate + LATE).sum())


def _cycles(setup: str, rate: float, node: np.ndarray, bare: np.ndarray) -> list[Row]:
    """Return how late cycles begin. node, bare: due and begun of each, ns."""
    period = 1e3 / rate
    between, alone = np.diff(node[:, 1]) / 1e6, np.diff(bare[:, 1]) / 1e6
    late, late_alone = _late(node[:, 1], rate), _late(bare[:, 1], rate)
    numbers = np.round((node[:, 0] - node[0, 0]) * rate / 1e9)
    on_grid = (node[-1, 1] - node[0, 1]) / 1e6 / numbers[-1]
    left_out, bare_out = int(numbers[-1]) + 1 - len(node), _left_out(bare, 1e9 / rate)
    return [
        (f"{setup}: cycles later than {period + LATE:.1f} ms", "≤ 1.5 × bare loop",
         f"{late} of {len(between)}, bare {late_alone}, ratio {late / max(1, late_alone):.2f}"),
        (f"{setup}: mean period on the grid", "exact to 0.1 %",
         f"off by {100 * abs(on_grid / period - 1):.4f} %"),
        (f"{setup}: cycles left out, due before the one before began", "",
         f"{left_out}, {100 * left_out / numbers[-1]:.3f} %; a bare loop that leaves them out: {bare_out}"),
        (f"{setup}: period p99, max", "", f"{np.quantile(between, 0.99):.3f}, {between.max():.2f} ms;"
         f" bare {np.quantile(alone, 0.99):.3f}, {alone.max():.2f} ms"),
    ]  # fmt: skip


def _left_out(cycles: np.ndarray, period: float) -> int:
    """Count the cycles that a loop would not begin because the next one is due already."""
    k = count = 0
    while k < len(cycles):
        late = int((cycles[k, 1] - cycles[k, 0]) / period)
        count, k = count + late, k + 1 + late
    return count


def _latencies(setup: str, node: np.ndarray, delays: FloatArray) -> list[Row]:
    """Return the latencies of publication and reception. node: sample, publication, ns or 0; delays: ms."""
    replied = node[:, 0] > 0
    published = (node[replied, 1] - node[replied, 0]) / 1e6
    (p50, p99), (r50, r99) = np.quantile(published, [0.5, 0.99]), np.quantile(delays, [0.5, 0.99])
    return [
        (f"{setup}: cycles without a reply in time", "", f"{(~replied).sum()} of {len(node)}"),
        (f"{setup}: bus read to published, p50, p99", "p99 < 0.5 ms", f"{p50:.3f}, {p99:.3f} ms"),
        (f"{setup}: stamp to reception elsewhere, p50, p99", "p99 < 1 ms",
         f"{r50:.3f}, {r99:.3f} ms of {len(delays)}"),
    ]  # fmt: skip
