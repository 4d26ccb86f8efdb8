"""Random faults and requests at random instants, several at once, beside a monitor that knows one rule.

No torque unless active, commanded in the last 100 ms, without fault, and without a stop that no clear which
began later has ended. Services run in a thread of their own, as those of the node, and all else goes on
meanwhile. A motor in another mode is seen within a second in which it is heard; only then is its torque
judged: one that is in another mode and does not answer is beyond any driver. The seed of a violation repeats
the faults; it does not repeat stalls of the machine. A torque that the bench has kept while it stood still
itself, by its own account, is counted apart: a motor does not stand still, and no driver could have reached
it.
"""

import random
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from bench.driver.loop import RATE, Loop
from rsea_ros.errors import DeviceError
from rsea_ros.hardware.dynamixel.motor import LOOK, OVERDUE
from rsea_ros.hardware.peer.remote import RemoteBench

CALM = {
    "drop": 0.0, "delay": 0.0, "corrupt": 0.0, "wrong_crc": 0.0, "silent": False, "ft_silent": False,
    "twin": False,
}  # fmt: skip
MODE_SEEN = round(1e9 * (3.0 * LOOK + OVERDUE))
"""ns of cycles after which a driver has switched off a motor in another mode."""
LONGEST, GRACE = 100_000_000, 50_000_000
"""ns for which a command allows a torque, and after a fault: its cycle, the ramp, a lost write."""


class Watched:
    """A loop, the faults that it suffers, and the violations of its torque."""

    def __init__(self, bench: RemoteBench, seed: int) -> None:
        self.bench, self.loop, self.dice = bench, Loop(bench), random.Random(seed)
        self.commanded = self.since = 0
        self.silent = 0
        self.displaced = False
        self.violations: list[str] = []
        self.excused: list[str] = []
        self.happened: deque[str] = deque(maxlen=6)
        self.seen = self.faults = self.stops = 0
        self.stopped, self.cleared = -1, -1
        self.service: threading.Thread | None = None
        self.mode_changed, self.unheard = -MODE_SEEN, False
        self.looked = self.begun = time.monotonic_ns()

    def cycle(self) -> None:
        """Run a cycle, and check the commands that the motor has received since the last check."""
        guarded = self.loop.guarded
        if self.dice.random() < 0.01:
            self._happen()
        if not self.silent:
            self.commanded = time.monotonic_ns()
        self.silent = max(0, self.silent - 1)
        age = (time.monotonic_ns() - self.commanded) / 1e9
        before = guarded.fault
        guarded.cycle(40.0 * self.dice.uniform(-1.0, 1.0), age)
        if guarded.fault is not before:
            self.faults += guarded.fault is not None
            self.since = time.monotonic_ns()
        time.sleep(1.0 / RATE)

    def look(self) -> None:
        """Judge the torque that acts, at the instant at which the bench saw it: the answer may wait."""
        active, fault, since, commanded = (
            self.loop.guarded.enabled, self.loop.guarded.fault, self.since, self.commanded,
        )  # fmt: skip
        stopped, cleared = self.stopped, self.cleared
        acting = self.bench.ask("torque")
        (goal, on), now = acting["result"], acting["t"]
        held_up, self.looked = now - self.looked, now
        served = self.service is not None and self.service.is_alive()
        if (served or self.unheard) and now - self.mode_changed < MODE_SEEN:
            self.mode_changed = now
        if not goal or not on or now - self.mode_changed < MODE_SEEN:
            return
        self.seen += 1
        if not active:
            self._violated("torque while not active", held_up)
        elif now - commanded > LONGEST + GRACE:
            self._violated(f"commanded {(now - commanded) / 1e6:.0f} ms ago", held_up)
        elif cleared < stopped < now - GRACE and not served:
            self._violated(f"stopped {(now - stopped) / 1e6:.0f} ms ago", held_up)
        elif fault is not None and now - since > LONGEST + GRACE:
            self._violated(f"{fault} for {(now - since) / 1e6:.0f} ms", held_up)

    def _violated(self, why: str, held_up: int) -> None:
        """Note a violation with the faults before it; apart where the bench itself stood still."""
        still = self.bench.stood_still(time.monotonic_ns() - 10 * LONGEST)
        after = f"{(time.monotonic_ns() - self.begun) / 1e9:.1f} s after the start"
        told = f"{why}, {after}, this loop {held_up / 1e6:.0f} ms a turn, the bench still for {still:.0f} ms"
        told += f", after {'; '.join(self.happened)}"
        (self.excused if still > GRACE / 1e6 else self.violations).append(told)

    def _happen(self) -> None:
        events: tuple[tuple[str, Callable[[], object]], ...] = (
            ("silent", lambda: self._misbehave(silent=True)), ("drop", lambda: self._misbehave(drop=0.5)),
            ("corrupt", lambda: self._misbehave(corrupt=0.3)),
            ("delay", lambda: self._misbehave(delay=0.5, late=0.02)),
            ("ft silent", lambda: self._misbehave(ft_silent=True)),
            ("ft restart", lambda: self.bench.ask("ft_restart")),
            ("temperature", lambda: self.bench.ask("set", temperature=self.dice.choice((30, 90)))),
            ("torque off", lambda: self.bench.ask("set", torque_enable=0)),
            ("alert", lambda: self.bench.ask("alert", bits=32)), ("disable", self.loop.guarded.disable),
            ("mode", self._change_mode),
            ("twin", lambda: self._misbehave(twin=True)),
            ("jump", lambda: self.bench.ask("set", homing_offset=self.dice.choice((0, 30_000)))),
            ("other limits", lambda: self.bench.ask("set", torque_limit=self.dice.choice((300, 620)))),
            ("no commands", self._quiet), *(("stop", self._stop),) * 3,
            *((name, lambda name=name: self._call(name)) for name in ("clear", "reboot", "enable")),
            *(("recover", self._recover),) * 4,
        )  # fmt: skip
        name, event = self.dice.choice(events)
        begun = time.monotonic_ns()
        with suppress(DeviceError):
            event()
        took = (time.monotonic_ns() - begun) / 1e6
        self.happened.append(f"{name} at {(begun - self.begun) / 1e9:.2f} s ({took:.0f} ms)")

    def _misbehave(self, **how: object) -> None:
        self.bench.ask("misbehave", **{**CALM, **how})
        self.unheard = any(value for name, value in how.items() if not name.startswith("ft"))

    def _quiet(self) -> None:
        self.silent = self.dice.randrange(100)

    def _change_mode(self) -> None:
        self.bench.ask("set", mode=self.dice.choice((1, 3)))
        self.mode_changed = time.monotonic_ns()

    def _stop(self) -> None:
        self.loop.guarded.stop()
        self.stopped, self.stops = time.monotonic_ns(), self.stops + 1

    def _recover(self) -> None:
        self._misbehave()
        self.bench.ask("set", temperature=30, voltage=240, torque_limit=620, homing_offset=0)
        guarded, is_served = self.loop.guarded, self.service is not None and self.service.is_alive()
        if self.displaced and not is_served:  # a jump of which one way was seen ends by configure alone
            guarded.disable()
            guarded.device.close()
            guarded.open()
            self.displaced = False
        self._call("clear", "reboot", "clear", "enable")

    def _call(self, *services: str) -> None:
        """Call services one after the other in a thread, unless one is under way."""
        if self.service is None or not self.service.is_alive():
            self.service = threading.Thread(target=self._serve, args=(services,), daemon=True)
            self.service.start()

    def _serve(self, services: tuple[str, ...]) -> None:
        guarded = self.loop.guarded
        for name in services:
            if name == "reboot" and len(services) > 1 and guarded.fault is None:
                continue
            asked = time.monotonic_ns()
            try:
                if getattr(guarded, name)() is not False and name == "clear":
                    self.cleared = max(self.cleared, asked)
            except DeviceError as error:
                self.displaced = self.displaced or "expected cleanup and configure" in str(error)


def random_faults(folder: Path, *, minutes: float = 1.0, seed: int = 1) -> list[tuple[str, str, str]]:
    """Run for --minutes with --seed."""
    with RemoteBench(folder / "tty") as bench:
        watched, end = Watched(bench, seed), time.monotonic() + 60.0 * minutes
        while time.monotonic() < end:
            watched.cycle()
            watched.look()
        bench.ask("misbehave", **CALM)
        if watched.service is not None:
            watched.service.join()
        with suppress(DeviceError):
            watched.loop.device.close()
    what = f"{minutes:g} min of random faults, seed {seed}: violations"
    first = f": {' | '.join(watched.violations[:5])}" if watched.violations else ""
    told = f"{len(watched.violations)}{first}; {watched.faults} faults, {watched.stops} stops"
    told += f", torque in {watched.seen} cycles"
    told += f"; the bench itself stood still under torque {len(watched.excused)} times"
    return [(what, "0", told)]
