"""Each fault on the wire: torque at the motor, when it is zero, whether it is latched, how it recovers.

Times are the bench's own, over the cycle's period: a machine that stalls shows in `most`. What is asked is
judged by the driver's own cycles until it writes zero, which no machine stretches; by time where it stands
still itself, is asked to end, or the supervisor is at work. The bench runs at SCHED_FIFO where that is
permitted. Where it or this loop stood still for a cycle and the driver did not hear it, the run does not
answer the question: it is repeated, and the repeats are reported.
"""

import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from bench.driver.loop import RATE, Loop, graded
from bench.driver.requests import requests
from rsea_ros.hardware.peer.remote import RemoteBench

RUNS, AGAIN = 3, 10
QUICK, SLOW = 4.0, 300.0
"""Periods within which the torque must be zero: for faults seen in each cycle, and once a second."""

Request = tuple[str, Mapping[str, Any]]


class Run(NamedTuple):
    """One run of a trial: periods and cycles until zero torque, the latched cause, and the end of it."""

    periods: float
    cycles: int
    cause: str
    ends: str


class Trial(NamedTuple):
    """How the bench is disturbed and restored, the service that ends the fault, the allowed periods.

    latched: whether it is a fault at all.
    """

    wrong: Request
    right: Request | None
    service: str = "clear"
    within: float = QUICK
    latched: bool = True


def misbehaves(within: float = QUICK + 3.0, latched: bool = True, **how: Any) -> Trial:
    """Return a trial of replies or records that go wrong."""
    calm = {name: False if value is True else 0.0 for name, value in how.items() if name != "late"}
    return Trial(("misbehave", how), ("misbehave", calm), within=within, latched=latched)


def reads(name: str, value: float, right: float, within: float = QUICK) -> Trial:
    """Return a trial of an item of the control table."""
    return Trial(("set", {name: value}), ("set", {name: right}), within=within)


def paces(rate: float, latched: bool = True) -> Trial:
    """Return a trial of an F/T sensor whose record rate (Hz) is changed."""
    return Trial(("ft_rate", {"rate": rate}), ("ft_rate", {"rate": 1000.0}), within=20.0, latched=latched)


def host(what: str, within: float, service: str = "clear") -> Trial:
    """Return a trial of an event in the driver itself, given by a function of this file."""
    return Trial(("host", {"what": what}), None, service, within)


def alerts(bits: int) -> Trial:
    """Return a trial of the motor's own alert."""
    return Trial(("alert", {"bits": bits}), None, "reboot")


def complains(bits: int, latched: bool = True) -> Trial:
    """Return a trial of status bits of the F/T sensor."""
    return Trial(("ft_status", {"bits": bits}), ("ft_status", {"bits": 0}), latched=latched)


FAULTS: dict[str, Trial] = {
    "silent motor": misbehaves(silent=True),
    "all replies dropped": misbehaves(drop=1.0),
    "a fifth of the replies dropped": misbehaves(2000.0, drop=0.2),
    "half of the replies truncated": misbehaves(300.0, truncate=0.5),
    "half of the replies corrupt": misbehaves(300.0, corrupt=0.5),
    "half of the replies 20 ms late": misbehaves(300.0, delay=0.5, late=0.02),
    "late, corrupt and dropped at once": misbehaves(300.0, drop=0.3, corrupt=0.3, delay=0.3, late=0.01),
    "dropped, and F/T silent": misbehaves(10.0, drop=1.0, ft_silent=True),
    "replies unstuffed": misbehaves(latched=False, unstuffed=True),
    "half of the replies dropped": misbehaves(300.0, drop=0.5),
    "1 % of the replies dropped": misbehaves(latched=False, drop=0.01),
    "wrong CRC": misbehaves(wrong_crc=1.0),
    "half with a wrong CRC": misbehaves(300.0, wrong_crc=0.5),
    "truncated": misbehaves(truncate=1.0),
    "corrupt": misbehaves(corrupt=1.0),
    "1 % corrupt": misbehaves(latched=False, corrupt=0.01),
    "replies 100 ms late": misbehaves(delay=1.0, late=0.1),
    "replies 20 ms late": misbehaves(delay=1.0, late=0.02),
    "replies 6 ms late": misbehaves(delay=1.0, late=0.006),
    "hot, 71 °C": reads("temperature", 71, 30),
    "hot, 90 °C": reads("temperature", 90, 30),
    "hot, 127 °C": reads("temperature", 127, 30),
    "supply at 0 V": reads("voltage", 0, 240),
    "supply at 19 V": reads("voltage", 190, 240),
    "supply at 17 V": reads("voltage", 170, 240),
    "torque switched off": reads("torque_enable", 0, 0, SLOW),
    "mode changed": reads("mode", 3, 0, SLOW),
    "mode changed to velocity, turning": Trial(
        ("set", {"mode": 1, "goal_velocity": 3000}), ("set", {"mode": 0}), within=SLOW
    ),
    "position jumps by 0.5 rad": reads("homing_offset", 40_000, 0),
    "two motors of one ID": misbehaves(twin=True),
    "bit rate of the motor changed": reads("baud", 1, 3, QUICK + 3.0),
    "F/T rate 7000 Hz": paces(7000.0, latched=False),
    "F/T rate 500 Hz": paces(500.0, latched=False),
    "F/T rate 50 Hz": paces(50.0),
    "voltage sag": Trial(("sag", {"voltage": 15.0}), ("set", {"voltage": 240}), "reboot"),
    "F/T saturated": complains(0x8002_0000),
    "F/T supply out of range": complains(0x8800_0000),
    "F/T gauge broken": complains(0x8400_0000),
    **{
        f"F/T status bit {bit}": complains(0x8000_0000 | 1 << bit)
        for bit in (0, 1, 2, 3, 4, 17, 18, 19, 25, 28, 29, 30)
    },
    "F/T condition latch alone": complains(0x8001_0000, latched=False),
    "F/T silent": misbehaves(10.0, ft_silent=True),
    "F/T values stand still": misbehaves(40.0, ft_stuck=True),
    "half of the F/T records dropped": misbehaves(latched=False, ft_drop=0.5),
    "all F/T records but one in a hundred dropped": misbehaves(20.0, ft_drop=0.99),
    "a tenth of the F/T records dropped": misbehaves(latched=False, ft_drop=0.1),
    "F/T restart": Trial(("ft_restart", {}), None, within=10.0),
    "F/T gap of 1000 records": Trial(("ft_gap", {"records": 1000}), None, latched=False),
    "F/T gap of 2 million records": Trial(("ft_gap", {"records": 2_000_000}), None, latched=False),
    "driver stands still for 0.3 s": host("stand_still", 120.0),
    "supervisor stands still": host("stop_supervisor", 280.0),
    "supervisor killed": host("kill_supervisor", 40.0),
    "service stop": host("stop", QUICK),
    "asked to end by a signal": host("halt", QUICK)._replace(latched=False),
    "commands cease": host("silence", 25.0),
    "motor reboots by itself": host("reboot", 10.0, "reboot"),
    "adapter pulled out": Trial(("vanish", {}), ("appear", {}), within=1e9),
    **{
        f"hardware alert: {name}": alerts(bits)
        for name, bits in (
            ("voltage", 1), ("hall", 2), ("heat", 4), ("encoder", 8), ("shock", 16), ("overload", 32),
            ("two", 36),
        )
    },
}  # fmt: skip


ON_ANY_BUS = (
    "silent", "replies dropped", "dropped, and", "late", "hot", "torque switched", "F/T", "driver stands",
    "supervisor", "service stop", "asked to end", "commands cease", "adapter",
)  # fmt: skip
"""In the names of what happens on CAN, too, where the controllers drop a frame that is damaged."""


def faults_on_can(model: str) -> dict[str, Trial]:
    """Return the faults of a drive on CAN: its ID, its angle, its state, its errors by its family's codes."""
    trials = {name: trial for name, trial in FAULTS.items() if any(word in name for word in ON_ANY_BUS)}
    trials |= {
        "two motors of one ID": misbehaves(QUICK + 2.0, twin=True),
        "position jumps by 0.5 rad": reads("origin", 800, 300),
        "two fifths of the replies dropped": misbehaves(2000.0, drop=0.4),
        "torque switched off": reads("torque_enable", 0, 0, 40.0 if model[0] in "Am" else QUICK),
    }
    codes = {"D": (8, 9, 10, 11, 12, 14), "R": (1, 2, 4, 8, 16, 32), "C": (1, 2, 4, 8, 16, 32)}
    if model[0] == "A":  # its protocol has nothing that ends an error
        mended = ("set", {"hardware_error": 0})
        trials |= {f"error {code}": Trial(("alert", {"bits": code}), mended) for code in range(1, 7)}
    trials |= {f"error {code}": alerts(code) for code in codes.get(model[0], ())}
    if model[0] in "DR":  # a watchdog of its own
        trials = {name: trial for name, trial in trials.items() if "supervisor" not in name}
        ends = "reboot" if model[0] == "D" else "clear"
        trials["driver stands still for 0.3 s"] = host("stand_still", 120.0, ends)
    del trials["a fifth of the replies dropped"]  # one reply a cycle, not two
    if model[0] in "Am":  # no frame of theirs tells a reading from one that is two cycles old
        del trials["replies 6 ms late"]
    if model == "mini-cheetah":
        trials = {name: trial for name, trial in trials.items() if "hot" not in name}
    return trials


def faults(folder: Path, *, can: str = "") -> Iterator[tuple[str, str, str]]:
    """Provoke each fault several times, then the requests and motors of requests.py.

    can: model of a drive on CAN instead.
    """
    with RemoteBench(folder / "tty", *(("--can", can) if can else ())) as bench:
        bench.hurry()
        loop = Loop(bench)
        for name, trial in (faults_on_can(can) if can else FAULTS).items():
            runs, again, why = _runs(loop, bench, trial)
            zero, cycles = [run.periods for run in runs], [run.cycles for run in runs]
            latched = sum(run.cause != "" for run in runs)
            cause, ends = ", ".join(sorted({run.cause for run in runs} - {""})), runs[-1].ends
            asked = f"latched, ≤ {trial.within:g} periods" if trial.latched else "no fault"
            judged = zero if trial.wrong[0] == "host" else cycles
            good = all((run.cause != "") == trial.latched for run in runs)
            good = good and (not trial.latched or median(judged) <= trial.within) and ends != "nothing"
            text = f"zero after {median(zero):.1f} (most {max(zero):.1f}) periods, "
            text = text + f"{median(cycles):g} cycles, " if trial.latched else ""
            told = f"latched {latched} of {RUNS} {cause or '-'}, ends by {ends}"
            told += f"; {again} done again: {why}" if again else ""
            yield name, asked, graded(text + told, good)
        loop.device.close()
    if not can:
        yield from requests(folder)


def _runs(loop: Loop, bench: RemoteBench, trial: Trial) -> tuple[list[Run], int, str]:
    """Return RUNS of a trial, the number of repeats after stalls of the machine, and the last stall."""
    runs: list[Run] = []
    again, why = 0, ""
    while len(runs) < RUNS:
        begun = time.monotonic_ns()
        run = _once(loop, bench, trial)
        still, waited = bench.stood_still(begun), 1e3 * max(loop.spent[-400:])
        missed = run.cause in ("no_reply", "ft") and max(still, waited) > 1e3 / RATE
        stalled = run.cause == "heldup" or missed
        if stalled and not trial.latched and again < AGAIN:
            again += 1
            why = f"{run.cause}, bench still for {still:.0f} ms, a cycle took {waited:.0f} ms"
        else:
            runs.append(run)
    return runs, again, why


def _once(loop: Loop, bench: RemoteBench, trial: Trial) -> Run:
    """Run a trial once."""
    loop.drive()
    age = 0.0
    if trial.wrong[0] == "host":
        begun = bench.ask("torque")["t"]
        age = HOST[trial.wrong[1]["what"]](loop) or 0.0
    else:
        begun = bench.ask(trial.wrong[0], **trial.wrong[1])["t"]
    cycles = loop.cycles(400 if trial.latched else 60, loop.is_latched, age)
    cause = loop.guarded.fault.cause if loop.guarded.fault else ""
    cycles += loop.cycles(60, lambda: loop.guarded.guard.torque == 0.0, age and age + cycles / RATE)
    for _ in range(6):
        loop.cycle(age)
    log = bench.log(begun)["torque"]
    acted = max((at for at, (_, goal, on) in enumerate(log) if goal and on), default=-1)
    ended = log[acted + 1][0] if acted + 1 < len(log) else log[-1][0] if log else begun
    if trial.right is not None:
        bench.ask(trial.right[0], **trial.right[1])
    if trial.service == "reboot":
        bench.ask("set", voltage=240)
    for _ in range(6):  # what is put right is a step of its own, of the position, which a reading must have
        loop.cycle(age)
    return Run((ended - begun) * RATE / 1e9, cycles, cause, _recover(loop, trial.service))


def _signal_supervisor(loop: Loop, number: int) -> None:
    supervisor = loop.device.protection._supervisor  # type: ignore[attr-defined]
    assert supervisor is not None
    os.kill(supervisor._end._process.pid, number)  # type: ignore[attr-defined]


HOST: dict[str, Callable[[Loop], float | None]] = {
    "stand_still": lambda loop: time.sleep(0.3),
    "kill_supervisor": lambda loop: _signal_supervisor(loop, signal.SIGKILL),
    "stop_supervisor": lambda loop: _signal_supervisor(loop, signal.SIGSTOP),
    "stop": lambda loop: loop.guarded.stop(),
    "halt": lambda loop: setattr(loop.guarded.interlock, "halted", True),
    "silence": lambda loop: 1.0 / RATE,
    "reboot": lambda loop: loop.device._motor.bus.reboot(),
}
"""Event in the driver; the age of its command where commands cease."""


def _recover(loop: Loop, service: str) -> str:
    """Call the service until it ends the fault; return its answer."""
    loop.guarded.interlock.halted = False
    for attempt in range(1, 6):
        if loop.call(service) == "done":
            return service if attempt == 1 else f"{service} at attempt {attempt}"
    return "nothing"
