"""One lost reply, and 1 % of the packets lost for a while: their cost, and a check that no value is wrong."""

from __future__ import annotations

import argparse
import math
import statistics
import time
from pathlib import Path

from bench.driver.loop import Loop
from rsea_ros.hardware.dynamixel.control_tables import TABLES
from rsea_ros.hardware.peer.remote import RemoteBench

RATE, SHARE, SECONDS = 280.0, 0.01, 60.0
PATIENT = 0.02
BROKEN = ("drop", "corrupt", "truncate", "wrong_crc")


def loss(args: argparse.Namespace, folder: Path) -> list[tuple[str, str, str]]:
    """Run with a time-out that no stall reaches, for the counts; then with the driver's own, for the cost."""
    seconds = min(SECONDS, 2.0 * args.seconds)
    with RemoteBench(folder / "tty") as bench:
        counted, broken, loop, log = _lose_replies(bench, seconds, PATIENT)
        wrong = f"{_wrong(loop, log)} of {len(loop.states)}"
        _, _, hasty, _ = _lose_replies(bench, min(10.0, seconds), 0.0)
    return [
        (f"{seconds:g} s with {SHARE:.0%} of the replies broken: wrong values", "0", wrong),
        ("  losses counted", "all", f"{counted} counted, {broken} made by the bench"),
        ("  cycle with a lost reply, median", "1 cycle, not 34 ms", _costs(hasty)),
    ]


def _lose_replies(bench: RemoteBench, seconds: float, latency: float) -> tuple[int, int, Loop, dict]:
    """Run with broken replies; return how many were counted and made, the loop, and the bench's log."""
    begin = time.monotonic_ns()
    before = sum(bench.log(begin)["misbehaved"].values())
    loop = Loop(bench, RATE, lost_cycles=100, ft_timeout=1.0, latency=latency)
    bench.ask("misbehave", **{kind: SHARE / len(BROKEN) for kind in BROKEN})
    loop.run(seconds, lambda k: 10.0 * math.sin(0.1 * k))
    bench.ask("misbehave", **dict.fromkeys(BROKEN, 0.0))
    log, health = bench.log(begin), loop.device.health()
    loop.device.close()
    counted = sum(int(health.get(f"bus_{kind}", 0)) for kind in ("lost", "corrupt"))
    return counted, sum(log["misbehaved"].values()) - before, loop, log


def _costs(loop: Loop) -> str:
    usual = statistics.median(loop.spent)
    late = sorted(t for t in loop.spent if t > 0.4 / RATE)
    if not late:
        return "none was lost"
    return f"{1e3 * statistics.median(late):.2f} of {1e3 / RATE:.2f} ms, usual {1e3 * usual:.2f} ms"


def _wrong(loop: Loop, log: dict) -> int:
    """Count the samples that the bench has not logged as sent."""
    table = TABLES[54024]
    start = table.sample[0]
    sent = {
        (table.position.value(d, start), table.velocity.value(d, start), table.current.value(d, start))
        for d in (bytes.fromhex(text) for _, address, text in log["replies"] if address == start)
    }
    turn, origin = 2.0 * math.pi / table.pulses, loop.device.origin
    got = (
        (
            round((s.position + origin) / turn),
            round(s.velocity / table.radian_per_second),
            round(s.current / table.ampere),
        )
        for s in loop.states
    )
    return sum(values not in sent for values in got)
