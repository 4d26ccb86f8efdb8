"""controller: makes the distal torque follow desired_torque, with every load from locked to free."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import JointState, Trigger, torque_command_message
from rsea_ros.control.controller import Measurement
from rsea_ros.control.grid import Grid
from rsea_ros.control.polarity import Polarity
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes import _control
from rsea_ros.nodes._control import TABLE, ControllerLimits, Measurements
from rsea_ros.nodes._cycle import SECOND, Anchor, keep_time
from rsea_ros.nodes._health import ERROR, OK, WARN, Health, NodeHealth
from rsea_ros.nodes._joints import Jobs
from rsea_ros.nodes._parameters import let_change
from rsea_ros.nodes._qos import COMMAND, await_arrival
from rsea_ros.nodes._run import Component, Program
from rsea_ros.nodes._tap import raw_writer
from rsea_ros.nodes._waiter import Waiter

WATCH = 0.005
"""s between two looks at the age of the last measurement."""
CLOSING_ZEROS = 3
FADE = 0.02
"""Part by which a desired torque's lateness replaces the mean of those before."""


class ControllerNode(Program):
    """One command for each measurement, stamped with the place of the next: one sample of delay, always.

    Not with the measurement's own stamp and a period: one that is late would act in the cycle after.
    """

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        self._stated, values = values, _control.with_limits(values)
        self._node, self._values = node, values
        self._design = _control.design_of(values)
        self._link = _control.link_of(values, self._design)
        self._controller = self._newest = _control.controller_of(values, self._design, self._link.share)
        self._period = SECOND / values["rate"]
        self._inputs = Measurements(
            node, values["axis"], self._period, values["joint"],
            encoder=self._link.encoder, limit=values["torque_limit"],
        )  # fmt: skip
        self._desired = self._inputs.desired
        self._anchor, self._grid = Anchor(), Grid(self._period)
        self._limits = ControllerLimits(values)
        self._polarity = Polarity(load_rig(values["rig"]), values["rate"], values["torque_limit"])
        self._last, self._heard, self._watched, self._lag, self._torque = 0, 0, 0, 0.0, 0.0
        self._fault, self._told_fault, self._release = "", "", (0, 0.0)
        self._wished = self._held = False
        self._steps = self._missed = self._limited = self._late = self._late_reported = self._restarts = 0
        self._told_losses, self._told_ignored = 0, dict[str, int]()
        self._squares: list[float] = []
        self._commands = node.create_publisher(JointState, "torque_command", COMMAND)
        self._writer = raw_writer(torque_command_message(0, 0.0, values["joint"]), "effort")
        self._lock = threading.Lock()
        node.create_service(Trigger, "~/clear_fault", self._clear)
        self._health = Health(node, self._report, values["rig"])
        for line in (*_control.summary(self._design), f"{self._link}"):
            node.get_logger().info(line)
        self._waiter = Waiter(node, self._inputs.subscriptions, self._work, WATCH)
        keep_time(node, self._waiter, values)
        let_change(node, TABLE, self._change)
        Jobs(node).set_parameters()  # for a driver in the same executor has to hear a stop meanwhile

    def _change(self, new: dict[str, Any]) -> None:
        """Take new limits, raised ones only without torque, and gains, which begin softly.

        Raises ParameterError for gains that are unstable with a load, or a limit raised under torque.
        """
        stated = {**self._stated, **new}
        derived = _control.with_limits(stated)
        values = {**self._values, **{name: derived[name] for name in new}}
        design, newest, link = self._design, self._newest, self._link
        if not new.keys().isdisjoint(_control.GAINS):
            design = _control.design_of(values)
            share = link.share if link.encoder is None else _control.link_of(values, design).share
            link, newest = link._replace(share=share), _control.controller_of(values, design, share)
        with self._lock:
            raised = [name for name in _control.LIMITS if values[name] > self._values[name]]
            if raised and self._wished and not self._fault:
                raise ParameterError(f"{raised[0]} is raised under torque, expected clear_fault first")
            for controller in (self._controller, newest):
                controller.limit(_control.torque_limits(values))
            self._limits.limit(values)
            self._stated, self._values = stated, values
            self._design, self._newest, self._link = design, newest, link

    def _work(self) -> None:
        """Command for each measurement that came, and see to their absence."""
        with self._lock:
            self._anchor.follow()
            arrived = list(self._inputs.take())
            for k, (stamp, reading) in enumerate(arrived):
                if not self._fault:
                    self._measure(stamp, reading, len(arrived) if k == len(arrived) - 1 else 0)
            if time.monotonic_ns() - self._watched > WATCH * SECOND:
                self._watched = time.monotonic_ns()
                self._watch()

    def _measure(self, stamp: int, reading: Measurement, together: int) -> None:
        """Command for a measurement, one for each period of the grid that they lie on.

        together: how many came at once, for the newest of them; 0 for the others, which it replaces.
        """
        self._heard = time.monotonic_ns()
        if self._grid.jumps(stamp):  # the clock of the bench was set
            self._desired.shift(stamp - self._last)
            self._grid.forget()
            self._last, self._restarts = 0, self._restarts + 1
        periods = self._grid.place(stamp)
        if periods and (missed := periods - 1) > self._values["stale"] * self._values["rate"]:
            self._last = 0  # the model would be led through a pause that nobody has seen
        if periods:
            self._command(stamp, reading, missed if self._last else 0, together)

    def _command(self, stamp: int, reading: Measurement, missed: int, together: int) -> None:
        self._inputs.hear_desired(self._anchor)
        off = self._take_desired()
        if not self._last or self._limits.idle(self._torque, reading.motor_torque):
            self._polarity.start()
        late = (self._anchor.now() - stamp) / self._period - 1.0 if together else 0.0
        trust = self._limits.lateness.take(max(late, missed), max(together, int(missed > 0)))
        falsified = self._limits.falsified(stamp, reading, self._torque)
        torque = self._next_torque(reading, missed, trust, off, acts=together > 0)
        desired = self._desired.torque if self._polarity.proven else reading.ft
        if fault := falsified or self._polarity.contradiction or self._limits.fault(reading.ft, desired):
            return self._latch(fault)
        most = self._values["torque_limit"]  # pulses, too, keep one that was lowered
        self._torque = min(max(torque, -most), most)
        self._publish(self._grid.next)
        self._last = stamp
        self._steps, self._missed = self._steps + 1, self._missed + missed
        self._limited += self._controller.share.limited
        self._late += late > self._limits.lateness.tolerance.late
        self._squares.append((reading.ft - self._desired.torque) ** 2)

    def _next_torque(
        self, reading: Measurement, missed: int, trust: float, off: float, *, acts: bool
    ) -> float:
        """Return the torque that acts next: none before a desired torque, then pulses, then control.

        A desired torque that ceases or comes back is nobody's step: its error comes in as at a start.
        """
        desired = self._desired.torque if self._wished else None
        before, self._held = self._held, self._desired.age(0) is not None
        if not self._polarity.proven:
            torque = self._polarity.probe(reading, desired, missed, acts=acts)
            if torque is not None:
                return torque
            missed = self._start(reading)
        elif self._polarity.watch(reading, missed):
            return 0.0
        elif self._polarity.doubted:
            reading = replace(reading, ft=math.nan)  # a lost sample
        elif self._held != before or self._newest is not self._controller:
            missed = self._start(reading)
        torque = self._controller.step(
            reading,
            self._desired.torque,
            missed,
            trust=trust,
            offset=self._grid.offset,
            desired_offset=off,
        )
        self._polarity.sent(torque)
        return torque

    def _start(self, reading: Measurement) -> int:
        """Begin softly, with the newest gains; return how many samples were missed then."""
        self._controller = self._newest
        self._controller.start(reading, self._desired.torque)
        return 0

    def _take_desired(self) -> float:
        """Take the desired torque nearest to this sample; return by how many samples it is for later.

        Senders whose desired torques always come too late for their own sample mean a later one.
        """
        place = self._grid.at + (round(2.0 * self._period) if self._values["preview"] else 0)
        taken = self._desired.take(round(place + 0.5 * self._period))
        self._wished = self._wished or bool(taken)
        off = float((self._desired.stamp - place) / self._period)
        if taken:
            self._lag += FADE * (min(off + 0.5, 0.0) - self._lag)
        return off - self._lag

    def _latch(self, fault: str) -> None:
        self._fault, self._release = fault, (time.monotonic_ns(), self._torque)

    def _watch(self) -> None:
        """Latch a fault when measurements cease, and take the torque to zero."""
        now = time.monotonic_ns()
        age = (now - self._heard) / SECOND
        if self._last and not self._fault and age > self._values["stale"]:
            limit = 1e3 * self._values["stale"]
            self._latch(f"no usable measurement for {1e3 * age:.0f} ms, expected one within {limit:.0f} ms")
        if self._fault:
            begun, torque = self._release
            share = (now - begun) / SECOND / max(self._values["release"], WATCH)
            self._torque = torque * max(0.0, 1.0 - share)
            self._publish(self._anchor.now())

    def _publish(self, stamp: int) -> None:
        self._commands.publish(self._writer.write(stamp, (self._torque,)))

    def _clear(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Restart at zero torque with the next measurement."""
        with self._lock:
            self._fault, self._last, self._torque, self._wished = "", 0, 0.0, False
            self._grid.forget()
            self._limits.clear()
            self._desired.clear(self._anchor.now())
        response.success, response.message = True, "clear_fault: done"
        return response

    def is_finished(self) -> bool:
        """Run until stopped; report a new fault."""
        before, self._told_fault = self._told_fault, self._fault
        if self._told_fault not in ("", before):
            self._node.get_logger().error(f"{self._told_fault}; torque zero until clear_fault")
            self._health.publish()
        return not self._waiter.is_running()

    def close(self) -> None:
        """Command zero torque, and wait until that has arrived."""
        self._waiter.stop()
        after = max(self._last + round(self._period), self._anchor.now())
        for k in range(1, CLOSING_ZEROS + 1 if self._last else 1):
            self._commands.publish(self._writer.write(after + round(k * self._period), (0.0,)))
        await_arrival(self._commands)
        self._node.get_logger().info(f"torque zero after {self._steps} commands")

    def _report(self) -> NodeHealth:
        squares, self._squares = self._squares, []
        worst = min(self._design.margins.values(), key=lambda m: m.phase)
        share = self._controller.share
        ignored = {what: sender.ignored for what, sender in self._inputs.senders.items()}
        values = {
            "desired": f"{self._desired.torque:.3f}",
            "torque_command": f"{self._torque:.3f}",
            "error_rms": f"{math.sqrt(sum(squares) / len(squares)):.4f}" if squares else "none",
            "disturbance_and_error": f"{share.feedback:.3f}",
            "compensation": f"{share.compensation:.3f}",
            "commands": self._steps,
            "missed_measurements": self._missed,
            "unusable_measurements": self._inputs.unusable,
            "limited_commands": self._limited,
            "late_commands": self._late,
            "feedback_share": f"{self._limits.lateness.trust:.2f}",
            "restarts": self._restarts,
            **self._link.values(),
            **self._anchor.values(),
            "crossover_hz": f"{self._design.margins['locked'].crossover:.2f}",
            "phase_margin_deg": f"{worst.phase:.1f}",
            "gain_margin_db": f"{worst.gain:.1f}",
            "delay_margin_samples": f"{worst.delay:.2f}",
            "desired_watchdog_trips": self._desired.expired,
            "refused_desired": self._desired.refused,
            "ignored_desired": ignored["desired torques"],
            "ignored_measurements": ignored["joint_states"] + ignored["wrenches"],
        }
        warnings = [*filter(None, [self._limits.contradiction]), *self._loss_words()]
        for what, count in ignored.items():
            if new := count - self._told_ignored.get(what, 0):
                warnings.append(f"{new} {what} of a second publisher ignored")
        self._told_ignored = ignored
        new, self._late_reported = self._late - self._late_reported, self._late
        if new:
            warnings.insert(0, f"{new} commands more than a sample late, with less feedback")
        if self._fault:
            level, words = ERROR, self._fault
        elif not self._last:
            level, words = WARN, "waiting for joint_states and ft"
        elif not self._polarity.proven:
            level, words = OK, "waiting for desired_torque"
            if self._wished:
                level, words = WARN, (
                    "pulses of torque without feedback: signs of ft, joint_states and motor torque are open"
                )
        else:
            return NodeHealth(*((WARN, "; ".join(warnings)) if warnings else (OK, "running")), values)
        return NodeHealth(max(level, WARN) if warnings else level, "; ".join((words, *warnings)), values)

    def _loss_words(self) -> Iterator[str]:
        """Yield that the encoder on the link has ceased to count, as long as a trouble of it lasts."""
        if (encoder := self._link.encoder) is None or not encoder.losses:
            return
        new, self._told_losses = encoder.losses > self._told_losses, encoder.losses
        if new or (encoder.trouble and not encoder.used):
            yield f"without the link's motion: {encoder.trouble or 'deflection was lost for a moment'}"


NODE = Component("controller", TABLE, ControllerNode)
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
