"""Requests in the midst of each other, motors that are not the configured one, and limits in a wrong unit.

Each row is judged by the torque in the bench's own log while 10 N·m are commanded for 60 cycles after it. One
that a stall of the machine has ended, and nothing of its own, is repeated, and says so.
"""

import resource
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from subprocess import Popen
from tempfile import TemporaryDirectory
from typing import Any

from bench.driver.loop import RATE, Loop, graded
from rsea_ros.errors import DeviceError, ParameterError
from rsea_ros.hardware import supervisor
from rsea_ros.hardware.device import NoReply
from rsea_ros.hardware.interlock import DeviceFault
from rsea_ros.hardware.peer.remote import RemoteBench
from rsea_ros.nodes._devices import limits_of
from rsea_ros.nodes.driver import TABLE

CYCLES, SETTLED, AGAIN = 60, 4, 5
STALLED = "no_reply", "heldup"
"""Faults that no row provokes whose words begin with them."""
Row = tuple[str, str, str]
FAULT = DeviceFault("ft", detail="made by the bench")
NO_TORQUE = "no torque"


def requests(folder: Path) -> Iterator[Row]:
    """Try each with a driver of its own."""
    with RemoteBench(folder / "requests") as bench:
        bench.hurry()
        for name, trial in TRIALS.items():
            told, good, again = STALLED[0], False, -1
            while not good and told.startswith(STALLED) and again < AGAIN:
                again, loop = again + 1, _loop(bench)
                required, told, good = trial(loop)
                with suppress(DeviceError):
                    loop.device.close()
                _restore(bench)
            yield name, required, graded(told + (f"; done again {again} times" if again else ""), good)
        yield _wraps(bench)
        for each in UNITS:
            yield _wrong_unit(bench, *each)


def _loop(bench: RemoteBench) -> Loop:
    """Return a loop; a busy machine loses the replies to a configure now and then."""
    while True:
        with suppress(NoReply):
            return Loop(bench)


Trial = Callable[[Loop], tuple[str, str, bool]]


def _restore(bench: RemoteBench) -> None:
    bench.ask("appear")
    bench.ask("misbehave", ft_silent=False)
    bench.ask("model", number=54024)
    bench.ask("set", torque_limit=620, homing_offset=0, mode=0, hardware_error=0)


def _acting(loop: Loop, since: int | None = None) -> tuple[int, int]:
    """Run cycles; return how many writes acted since an instant, else from now on, and in the last cycles."""
    since = loop.bench.ask("torque")["t"] if since is None else since
    loop.cycles(SETTLED)
    late = loop.bench.ask("torque")["t"]
    loop.cycles(CYCLES)
    log = loop.bench.log(since)["torque"]
    acting = [t for t, goal, on in log if goal and on]
    return len(acting), sum(t >= late for t in acting)


def meanwhile(service: str, request: str, *, first: str = "") -> Trial:
    """Return a trial of a request 0.3 s after a service has begun, which waits for a silent F/T sensor.

    first: requested before both.
    """

    def trial(loop: Loop) -> tuple[str, str, bool]:
        loop.drive()
        loop.bench.ask("misbehave", ft_silent=True)
        while not loop.is_latched():
            loop.cycle()
        if first:
            getattr(loop.guarded, first)()
        answers: list[str] = []
        thread = threading.Thread(target=lambda: answers.append(loop.call(service)))
        thread.start()
        loop.cycles(round(0.3 * RATE))
        _REQUESTS[request](loop)
        loop.bench.ask("misbehave", ft_silent=False)
        while thread.is_alive():
            loop.cycle()
        acted, late = _acting(loop)
        return NO_TORQUE, f"{late} writes of a torque, {service}: {answers[0]}", acted == late == 0

    return trial


_REQUESTS: Mapping[str, Callable[[Loop], object]] = {
    "stop": lambda loop: loop.guarded.stop(),
    "deactivation": lambda loop: loop.guarded.disable(),
    "fault": lambda loop: loop.guarded.guard.trip(FAULT),
}


def stop_then_reboot(loop: Loop) -> tuple[str, str, bool]:
    """A reboot after a stop."""
    loop.drive()
    loop.guarded.stop()
    loop.cycle()
    answer = loop.call("reboot")
    acted, late = _acting(loop)
    return NO_TORQUE, f"{late} writes of a torque, reboot: {answer}", acted == 0


def stop_in_activation(loop: Loop) -> tuple[str, str, bool]:
    """A stop while the motor is being switched on."""
    loop.guarded.disable()
    enable, guarded = loop.device.enable, loop.guarded
    loop.device.enable = lambda: (guarded.stop(), enable())  # type: ignore[method-assign,assignment]
    answer = loop.call("enable")
    acted, late = _acting(loop)
    return NO_TORQUE, f"{late} writes of a torque, activation: {answer}", acted == 0 and answer != "done"


def other_motor(service: str, *, done: bool = False, **how: int) -> Trial:
    """Return a trial of a service after the motor was exchanged or set. done: whether it may be done then."""

    def trial(loop: Loop) -> tuple[str, str, bool]:
        loop.drive()
        loop.guarded.guard.trip(FAULT)
        loop.cycle()
        if service == "enable":
            loop.guarded.clear()
            loop.guarded.disable()
        since = loop.bench.ask("model" if "number" in how else "set", **how)["t"]
        answer = loop.call(service)
        acted, _ = _acting(loop, since)
        if not done:
            return "refused, no torque", f"{acted} writes: {answer}", acted == 0 and answer != "done"
        motor = loop.device._motor
        mode = motor.bus.patiently(lambda: motor.bus.get(motor.control_table.operating_mode))
        return "torque mode, then torque", f"{acted} writes: {answer}", acted > 0 and mode == 0

    return trial


def renamed_adapter(loop: Loop) -> tuple[str, str, bool]:
    """The adapter was pulled out and got another name."""
    loop.drive()
    loop.bench.ask("vanish")
    loop.bench.ask("appear", name="another")
    loop.cycles(20)
    cause, answer = loop.guarded.fault, loop.call("clear")
    loop.bench.ask("vanish")
    loop.bench.ask("appear")
    again = loop.call("clear")
    good = cause is not None and cause.cause == "portlost" and "port" in answer and again == "done"
    return "portlost until it is back", f"{cause}; clear: {answer}; back: {again}", good


def second_driver(loop: Loop) -> tuple[str, str, bool]:
    """Another driver opens the motor that has one."""
    loop.drive()
    since = loop.bench.ask("torque")["t"]
    try:
        answer = f"opened, {Loop(loop.bench)}"
    except DeviceError as error:
        answer = f"{error}"
    late = _acting(loop, since)[1]
    good = "expected a serial port that is free" in answer and late > 0.9 * CYCLES
    return "refused, the first goes on", f"{answer}; {late} writes of a torque", good


def supervisor_service(number: signal.Signals) -> Trial:
    """Return a trial of a signal to the service that is the driver's supervisor, under torque."""

    def trial(child: Loop) -> tuple[str, str, bool]:
        child.device.close()
        with TemporaryDirectory() as folder:
            path = Path(folder) / "supervisor"
            words = [sys.executable, supervisor.__file__, "--listen", str(path)]
            service = Popen(words)
            while not path.exists():
                time.sleep(0.01)
            loop = Loop(child.bench, supervisor=str(path))
            loop.drive()
            service.send_signal(number)
            cycles = loop.cycles(round(2 * RATE), loop.is_latched)
            cause, late = loop.guarded.fault, _acting(loop)[1]
            service.kill()
            service.wait()
            refused, service = loop.call("clear"), Popen(words)
            while (again := loop.call("clear")) != "done" and cycles < 3 * RATE:
                cycles += loop.cycles(1)
            loop.device.close()
            service.kill()
            service.wait()
        told = f"{cause} after {cycles} cycles, {late} writes of a torque; clear: {refused}; then {again}"
        good = f"{cause}".startswith("supervisorlost") and late == 0 and "listens there" in refused
        return "supervisorlost, refused without it", told, good and again == "done"

    return trial


def tare_under_torque(loop: Loop) -> tuple[str, str, bool]:
    """zero_ft at 10 N m."""
    loop.drive()
    answer = loop.call("zero_ft")
    torque = loop.states[-1].wrench[5] if loop.states[-1].wrench else 0.0
    return "refused", f"{answer}; ft {torque:.2f} N·m", "expected 0 N·m" in answer and torque > 8.0


@contextmanager
def no_room() -> Iterator[None]:
    """Let no file of this process grow, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def full_disk(loop: Loop) -> tuple[str, str, bool]:
    """Cycles, a stop and a clear without room on the disk."""
    with no_room():
        loop.drive()
        loop.guarded.stop()
        loop.cycle()
        stopped = loop.bench.torque()[0]
        answer = loop.call("clear")
        acted, _ = _acting(loop)
    told = f"stopped at {stopped}, clear: {answer}, then {acted} writes of a torque"
    return "as with room", told, stopped == 0 and answer == "done" and acted > 50


def _wraps(bench: RemoteBench) -> Row:
    """An encoder whose counts pass 2^31."""
    bench.ask("set", homing_offset=2**31 - 1234 - 4)
    loop = _loop(bench)
    loop.drive()
    last, fault = loop.states[-1].position, loop.guarded.fault
    loop.device.close()
    _restore(bench)
    good = fault is None and 0.001 < last < 0.1
    return "encoder wraps round at 2^31", "no fault, no jump", graded(f"{last:.4f} rad, {fault}", good)


def _wrong_unit(bench: RemoteBench, name: str, value: float, unit: str) -> Row:
    """A limit that was written in another unit."""
    try:
        values: dict[str, Any] = {p.name: p.check(value if p.name == name else p.default) for p in TABLE}
        loop = Loop(bench, limits_of(values))
        try:
            limits_of(values, loop.device.rating)
        finally:
            loop.device.close()
        told = "accepted"
    except ParameterError as error:
        told = f"{error}"
    return f"{name} in {unit}: {value:g}", "refused", graded(told, told != "accepted")


UNITS = (
    ("torque_limit", 68_000.0, "N·mm"), ("torque_limit", 602.0, "lbf·in"), ("temperature_limit", 158.0, "°F"),
    ("temperature_limit", 343.0, "K"), ("voltage_limit", 200.0, "0.1 V"), ("current_limit", 12_000.0, "mA"),
    ("ft_limit", 110_000.0, "N·mm"), ("deflection_limit", 87.3, "mrad"), ("deflection_limit", 5.0, "°"),
    ("velocity_limit", 286.0, "°/s"), ("effort_limit", 600.0, "N·cm"), ("effort_limit", 53.0, "lbf·in"),
    ("current_limit", 99.9, "dA"), ("voltage_limit", 2.0, "10 V"), ("voltage_limit", 0.02, "kV"),
    ("power_limit", 2500.0, "dW"), ("soft_start", 5e5, "N·mm/s"),
)  # fmt: skip
TRIALS: dict[str, Trial] = {
    **{
        f"{request} during {service}": meanwhile(service, request)
        for service in ("clear", "reboot")
        for request in ("stop", "deactivation", "fault")
    },
    "stop, then another during clear": meanwhile("clear", "stop", first="stop"),
    "stop, then reboot": stop_then_reboot,
    "stop during activation": stop_in_activation,
    "another model at clear": other_motor("clear", number=54025),
    "another model at reboot": other_motor("reboot", number=54025),
    "another model at activation": other_motor("enable", number=54025),
    "another current limit at clear": other_motor("clear", torque_limit=100),
    "another zero at activation": other_motor("enable", homing_offset=9),
    "position mode at clear": other_motor("clear", done=True, mode=3, torque_enable=0),
    "velocity mode at activation": other_motor("enable", mode=1, torque_enable=0, done=True),
    "adapter under a new name": renamed_adapter,
    "two drivers on one motor": second_driver,
    "supervisor service killed": supervisor_service(signal.SIGKILL),
    "supervisor service stands still": supervisor_service(signal.SIGSTOP),
    "zero_ft under torque": tare_under_torque,
    "disk full": full_disk,
}
