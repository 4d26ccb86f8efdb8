"""A joint of the driver: a device behind its limits, with topics, services and diagnostics of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from rclpy.node import Node

from msg_adapters.ros import Trigger
from rsea_ros.errors import DeviceError, RseaError
from rsea_ros.hardware.device import Device, State
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.interlock import DeviceFault, event
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.rig_limits import check_travel
from rsea_ros.nodes._bench_topics import BenchTopics
from rsea_ros.nodes._cycle import Anchor, Cycle
from rsea_ros.nodes._devices import limits_of, spring_of, witnesses_of
from rsea_ros.nodes._drive import DriverCycle
from rsea_ros.nodes._health import ERROR, OK, WARN, Health, NodeHealth
from rsea_ros.nodes._joints import Jobs
from rsea_ros.nodes._qos import COMMAND

LOST = {"failed_reads": "reads lost", "failed_writes": "writes lost"}
OVERTAKING = 0.05
"""s for which a stop waits with its answer: requests that were sent before may still be on their way."""
CONFIRMING = 0.5
"""s for which a motor may owe the acknowledgement that it is off, beside a reboot or a lost port."""
Work = Callable[[int], str]
"""What a service does; it is given the number of the request's event."""


class DrivenJoint:
    """values: parameters of this joint.
    part: its name among others, the namespace of its topics and services.
    jobs: threads of services. offers: the services of the node, to which those of this joint are added.
    drive, topics: present while the device is open.
    """

    def __init__(
        self, node: Node, jobs: Jobs, part: str, values: dict[str, Any], device: Device,
        offers: list[Offer],
    ) -> None:  # fmt: skip
        self._node, self._jobs, self.part, self._values = node, jobs, part, values
        limits = partial(limits_of, values)
        self.guarded = GuardedDevice(
            device, limits(), values["rate"], spring_of(values), limits, partial(witnesses_of, values)
        )
        self.drive: DriverCycle | None = None
        self.topics: BenchTopics | None = None
        self._cycle: Cycle | None = None
        self._ended = self._double = ""
        self._reported: tuple[DeviceFault | None, int] = (None, 0)
        self._health = Health(node, self.report, part=part)
        space, after = f"{part}/" if part else "", self._health.publish
        for name, work in (
            ("zero_ft", self._zero_ft), ("clear_fault", self.clear_fault), ("reboot", self._reboot),
        ):  # fmt: skip
            offers.append(Offer(node, jobs, space + name, work, after))
        offers.append(stop_of(node, jobs, f"{space}stop", [self], offers, after))
        self._offers = offers

    def open(self, anchor: Anchor) -> None:
        """Open the device and make its topics. Raises RseaError, OSError; nothing stays open then."""
        values = self._values
        self.guarded.open(unprotected=values["allow_no_dead_host_protection"])
        self._ended = ""
        health, limits = self.guarded.device.health(), self.guarded.guard.limits
        self._health.hardware = _hardware(values, health)
        self._node.get_logger().info(self.with_name(f"limits: {limits}"))
        if (number := health.get("ft_low_pass", "0")) != "0":
            text = f"F/T sensor: low pass (setuserfilter) {number}; the rig states it as sensors.ft.filter"
            self._node.get_logger().info(self.with_name(text))
        if limits.unlikely:
            self._node.get_logger().warning(self.with_name(limits.unlikely))
        self.topics = BenchTopics(
            self._node, {**values, "torque_limit": limits.torque}, strict=True,
            every_record=values["ft_all"], part=self.part, deflects=self.guarded.measures_deflection(),
        )  # fmt: skip
        self.drive = DriverCycle(self.guarded, self.topics, anchor, values["rate"])

    def change(self, values: Mapping[str, Any]) -> None:
        """Take new values of limits; before the device is open they count from configure on.

        Raises ParameterError for those that cannot be.
        """
        before = {name: self._values[name] for name in values}
        self._values |= values
        try:
            if self.drive is None:
                limits_of(self._values)
            else:
                self.guarded.limit([name.removesuffix("_limit") for name in values])
        except RseaError:
            self._values |= before
            raise

    def runs_in(self, cycle: Cycle) -> None:
        """Note the cycle, whose times are reported with this joint's health."""
        self._cycle = cycle

    def enable(self, *, zero_first: bool = False) -> None:
        """Switch the torque on and let commands through, from the next one on. Raises DeviceError.

        zero_first: see DriverCycle. Raises ParameterError where nothing limits a free end.
        """
        assert self.drive is not None
        if self._double:
            raise DeviceError(f"{self._double}: their torques and measurements would mix")
        if not self._values["allow_no_position_limit"]:
            check_travel(self.guarded.guard.limits.position, load_rig(self._values["rig"]))
        with self.drive.deaf():
            self.drive.zero_first = zero_first
            take_up(self._offers)
            self.guarded.enable()
            take_up(self._offers)

    def close(self) -> None:
        """Take the topics away; the device is closed already, or not open."""
        if self.topics is not None:
            self.topics.close()
        self._double = ""
        self._cycle = self.topics = self.drive = None

    def publish(self, state: State) -> None:
        """Publish a reading."""
        assert self.topics is not None and self.drive is not None
        self.topics.publish(state, self.drive.anchor.shift)

    def follow(self) -> None:
        """Log and publish changes: a fault, commands that were cut."""
        fault, limited = now = self.guarded.fault, self.guarded.guard.limited
        before, self._reported = self._reported, now
        if fault is not None and fault != before[0]:
            end = "clear_fault" if self.guarded.interlock.stopped else "clear_fault or reboot"
            text = f"fault {fault}; torque zero until {end}"
            self._node.get_logger().error(self.with_name(text))
            self._health.publish()
        if limited > before[1]:
            limits = self.guarded.guard.limits
            text = f"{limited} commands limited to {limits.torque:g} N·m and {limits.slew:g} N·m/s so far"
            self._node.get_logger().warning(self.with_name(text), throttle_duration_sec=1.0)

    def fail(self, error: Exception) -> None:
        """Log and keep the error that ended it."""
        self._ended = " ".join(str(error).split())
        self._node.get_logger().error(self.with_name(self._ended))

    def with_name(self, text: str) -> str:
        """Return a line of the log with the name of the joint if there are several."""
        return f"{self.part}: {text}" if self.part else text

    def clear_fault(self, asked: int) -> str:
        """End a fault whose cause is over. asked: see GuardedDevice.clear. Raises DeviceError."""
        drive = self.opened()
        if self.guarded.fault is None:
            return "there is no fault; nothing was done"
        with drive.deaf():
            self.guarded.clear(asked)
        return "done"

    def _zero_ft(self, asked: int) -> str:
        self.opened()
        self.guarded.zero_ft()
        return "done"

    def _reboot(self, asked: int) -> str:
        with self.opened().deaf():
            self.guarded.reboot()
        return "done" if self.guarded.fault is None else f"done; fault {self.guarded.fault}"

    def opened(self) -> DriverCycle:
        """Return what drives the open device. Raises RseaError without one."""
        if self.drive is None:
            raise RseaError("the driver is not configured, expected it to be")
        return self.drive

    def report(self) -> NodeHealth:
        """Return its health."""
        if self._cycle is None or self.topics is None:
            return NodeHealth(ERROR if self._ended else OK, self._ended or "not configured", {})
        self._cycle.rest()
        fault, cycles = self.guarded.fault, self.guarded.cycles
        lost = {words: cycles[name] for name, words in LOST.items()} if fault is None else {}
        report, self._double = self.topics.report(self._cycle, lost), self.topics.namesakes.look()
        values = {
            "active": self.guarded.enabled,
            "zero_first": self.drive is not None and self.drive.zero_first,
            "fault": fault or "none",
            "dead_host_protection": self.guarded.device.protection,
            "ft_source": self.guarded.ft_source,
            "lifted_limits": ", ".join(self.guarded.lifted) or "none",
            "limited_commands": self.guarded.guard.limited,
            **cycles,
            **report.values,
            "refused": self.guarded.guard.refused,
            "limits": self.guarded.guard.limits,
            "torque_limit": f"{self.guarded.guard.limits.torque:.6g}",
            **self.guarded.device.health(),
        }
        told, level = (f"fault {fault}", ERROR) if fault is not None else (self.guarded.contradiction, WARN)
        if self._double:
            told, level = "; ".join(filter(None, (self._double, told))), ERROR
            self._node.get_logger().error(self.with_name(self._double), throttle_duration_sec=10.0)
        if not told:
            return NodeHealth(report.level, report.summary, values)
        besides = "" if report.level == OK else f"; {report.summary}"
        return NodeHealth(level, f"{told}{besides}", values)


def stop(joints: Sequence[DrivenJoint]) -> str:
    """End the torque until a clear_fault that is asked for after the answer.

    Raises DeviceError where a motor has not acknowledged that it is off; the stop holds all the same.
    """
    for drive in [joint.drive for joint in joints if joint.drive is not None]:
        drive.stop()
    time.sleep(OVERTAKING)
    end = time.monotonic() + CONFIRMING
    while on := [joint for joint in joints if joint.drive is not None and not joint.guarded.is_off]:
        if time.monotonic() > end:
            if all(joint.guarded.away for joint in on):
                raise DeviceError(
                    "zero is commanded until clear_fault; the motor confirms it when another service is over"
                )
            why = ", ".join(joint.with_name(f"{joint.guarded.fault}") for joint in on)
            raise DeviceError(
                f"zero is commanded until clear_fault, but no motor has confirmed it ({why}), expected it"
                f" to be off within {CONFIRMING:g} s: cut its power"
            )
        time.sleep(0.1 * OVERTAKING)
    driven = any(joint.drive is not None for joint in joints)
    return f"torque zero until clear_fault, the {'motor is off' if driven else 'driver is not configured'}"


def stop_of(
    node: Node, jobs: Jobs, name: str, joints: Sequence[DrivenJoint], offers: list[Offer],
    after: Callable[[], None],
) -> Offer:  # fmt: skip
    """Return the service that stops joints. offers: services of which requests that wait came before it.

    The middleware hands the requests of several services over in any order, and a busy executor late.
    """

    def hold() -> None:
        for joint in joints:
            joint.guarded.stop(is_answered=False)

    def answer() -> None:
        take_up(offers)
        for joint in joints:
            joint.guarded.interlock.answer()
        after()

    return Offer(node, jobs, name, lambda asked: stop(joints), answer, hold)


def take_up(offers: Sequence[Offer]) -> None:
    """Take up the requests that wait, in the executor's thread."""
    for offer in offers:
        offer.take_up()


class Offer:
    """A service ~/NAME that does some work in a thread, and answers with the error where it fails.

    after: called before the answer. at_once: called where a request is taken.
    """

    def __init__(
        self, node: Node, jobs: Jobs, name: str, work: Work, after: Callable[[], None],
        at_once: Callable[[], None] = lambda: None,
    ) -> None:  # fmt: skip
        self._node, self._jobs, self._name, self._work, self._after = node, jobs, name, work, after
        self._at_once = at_once
        self._service = node.create_service(
            Trigger, f"~/{name}", self._serve, qos_profile=COMMAND, callback_group=jobs.group
        )  # ROS's own queue of ten left 36 of 50 callers without an answer

    def take_up(self) -> None:
        """Take up the requests that wait, in the executor's thread."""
        while True:
            with self._service.handle:
                _, header = self._service.handle.service_take_request(Trigger.Request)
            if header is None:
                return
            self._at_once()
            self._jobs.soon(self._reply, event(), header)

    async def _reply(self, asked: int, header: Any) -> None:
        self._service.send_response(await self._answer(asked, Trigger.Response()), header)

    async def _serve(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._at_once()
        return await self._answer(event(), response)

    async def _answer(self, asked: int, response: Trigger.Response) -> Trigger.Response:
        try:
            told = await self._jobs.do(partial(self._work, asked))
            response.success, response.message = True, f"{self._name}: {told}"
        except RseaError as error:
            response.success, response.message = False, f"{self._name}: {' '.join(str(error).split())}"
        self._node.get_logger().info(response.message)
        self._after()
        return response


def _hardware(values: Mapping[str, Any], health: Mapping[str, object]) -> str:
    """Return the subject of diagnostics: motor and port, or simulation."""
    if "motor" not in health:
        return f"{values['device']} {values['rig']}"
    sensor = f", F/T sensor at {values['ft_host']}" if values["ft_host"] else ""
    return f"{health['motor']}, ID {values['id']} on {values['port']}{sensor}"
