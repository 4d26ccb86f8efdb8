"""driver: an actuator behind the Device interface, as a lifecycle node.

configure opens the device and starts the cycle: measurements are published, the torque is off. activate
switches it on, at zero, and lets commands through. deactivate, cleanup, shutdown, a signal and an exception
zero it and switch it off. A fault, and the service stop, zero it until the service clear_fault or reboot; the
node stays active.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, ManagedEntity, TransitionCallbackReturn

from msg_adapters.ros import Trigger
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.hardware.guarded import Guarded
from rsea_ros.hardware.limits import Fault
from rsea_ros.hardware.outside import EXTRA_PATH, options_of
from rsea_ros.nodes._alarm import Alarm
from rsea_ros.nodes._anchor import Anchor
from rsea_ros.nodes._bench import NAMES, SPRING_FRAME, Bench
from rsea_ros.nodes._cycle import Cycle
from rsea_ros.nodes._device_parameters import LIMITS, MOTOR, SAFETY, SENSOR
from rsea_ros.nodes._devices import DEVICES, device_of, limits_of, spring_of
from rsea_ros.nodes._drive import Drive
from rsea_ros.nodes._health import ERROR, OK, Health, Report
from rsea_ros.nodes._jobs import Jobs
from rsea_ros.nodes._parameters import Parameter
from rsea_ros.nodes._realtime import REALTIME, keep_time, usual_priority
from rsea_ros.nodes._run import run_node
from rsea_ros.wording import printable

TABLE = (
    Parameter("device", "simulated", f"what to drive: {', '.join(DEVICES)}, or one of RSEA_DEVICES"),
    Parameter("rate", 280.0, "cycles a second", "Hz", 10.0, 1000.0),
    Parameter("rig", "paper_high_impedance", "the bench: a name of config/rigs, or a file"),
    Parameter("seed", 0, "seed of the simulated sensors' noise", "", 0, 1_000_000_000),
    Parameter("autostart", False, "whether to configure and activate at once"),
    REALTIME,
    *SAFETY,
    *MOTOR,
    *SENSOR,
    *LIMITS,
    *NAMES,
    SPRING_FRAME,
)


LOST = {"failed_reads": "reads lost", "failed_writes": "writes lost"}
PATIENCE = 10.0
"""s that a reboot may take which is under way when the program ends."""


class Driver(ManagedEntity):
    """One device behind its limits, its cycle and its topics, from configure to cleanup."""

    def __init__(self, node: LifecycleNode, values: dict[str, Any]) -> None:
        self._node, self._values = node, values
        if node.get_parameter("use_sim_time").value:
            raise ParameterError("parameter use_sim_time = true, expected false: the device keeps real time")
        if values["device"] not in DEVICES and (files := os.environ.get(EXTRA_PATH)):
            text = f"{EXTRA_PATH}={printable(files)}: code from there runs in this node"
            node.get_logger().warning(text)
        given = values | {"device_options": options_of(values["device_options"])}
        device = device_of(given, DEVICES)
        self._guarded = Guarded(device, limits_of(values), values["rate"], spring_of(values))
        self._cycle: Cycle | None = None
        self._bench: Bench | None = None
        self._drive: Drive | None = None
        self._ended = ""
        self._told: tuple[Fault | None, int] = (None, 0)
        self._health = Health(node, self._report)
        self._jobs, self._alarm = Jobs(node), Alarm(self._halt)
        for name, work in (
            ("zero_ft", self._zero_ft), ("clear_fault", self._clear_fault), ("reboot", self._reboot),
            ("stop", self._stop),
        ):  # fmt: skip
            self._offer(name, work)
        node.add_managed_entity(self)
        if values["autostart"] and node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            node.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the device and begin to publish what it measures."""
        try:
            self._guarded.open(unprotected=self._values["allow_no_dead_host_protection"])
        except (RseaError, OSError) as error:
            self._fail(error)
            return TransitionCallbackReturn.FAILURE
        self._ended = ""
        self._health.hardware = _hardware(self._values, self._guarded.device.health())
        self._bench = Bench(self._node, self._values, strict=True, every_record=self._values["ft_all"])
        anchor = Anchor()
        self._drive = Drive(self._guarded, self._bench, anchor, self._values["rate"])
        self._cycle = Cycle(self._values["rate"], self._step, catch_up=False, anchor=anchor)
        keep_time(self._node, self._cycle, self._values["realtime_priority"])
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Switch the torque on and let commands through, from the next one on; not with a fault latched."""
        assert self._drive is not None
        try:
            with self._drive.deaf():
                self._guarded.enable()
        except RseaError as error:
            self._node.get_logger().error(f"not activated: {error}")
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Zero torque, switched off; measurements go on."""
        try:
            self._guarded.disable()
        except RseaError as error:
            self._node.get_logger().error(f"while deactivating: {error}")
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Command zero torque, close the device, take the topics away."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    on_shutdown = on_error = on_cleanup

    def finished(self) -> bool:
        """Tell of faults; go back to unconfigured when the cycle has ended with an exception.

        What the executor does next begins between two cycles.
        """
        self._tell()
        if self._cycle is not None:
            self._cycle.rest()
        error = self._cycle.error if self._cycle is not None else None
        if error is not None:
            self._fail(error)
            if self._guarded.enabled:
                self._node.trigger_deactivate()
            self._node.trigger_cleanup()
        return False

    def conclude(self) -> None:
        """Leave nothing to do."""

    def close(self) -> None:
        """Zero torque, device closed, topics gone; also when there are none."""
        self._guarded.enabled = False
        self._jobs.join(PATIENCE)
        try:
            if self._cycle is not None:
                self._cycle.stop()
        finally:
            self._guarded.device.close()
        if self._cycle is not None and self._values["realtime_priority"]:
            usual_priority()
        if self._bench is not None:
            self._bench.close()
        if self._cycle is not None:
            self._node.get_logger().info("torque zero, device closed")
        self._cycle = self._bench = self._drive = None

    def _halt(self) -> None:
        """End the torque with the next cycle: the process was asked to end."""
        self._guarded.guard.halted = True

    def _step(self, stamp: int) -> None:
        """Do a cycle of the device and publish what it read."""
        drive, bench = self._drive, self._bench
        assert drive is not None and bench is not None
        try:
            state = drive.step(stamp)
            if state is not None:
                bench.publish(state, drive.anchor.shift)
        except Exception:
            self._guarded.device.close()
            raise

    def _zero_ft(self) -> str:
        self._guarded.zero_ft()
        return "done"

    def _clear_fault(self) -> str:
        assert self._drive is not None
        if self._guarded.fault is None:
            return "there is no fault; nothing was done"
        with self._drive.deaf():
            self._guarded.clear()
        return "done"

    def _reboot(self) -> str:
        assert self._drive is not None
        with self._drive.deaf():
            self._guarded.reboot()
        return "done"

    def _stop(self) -> str:
        assert self._drive is not None
        self._drive.stop()
        return "torque zero until clear_fault"

    def _offer(self, name: str, work: Callable[[], str]) -> None:
        """Offer a service that does some work, and answers with the error where it fails."""

        async def serve(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                if self._drive is None:
                    raise RseaError(f"{name}: the driver is not configured, expected it to be")
                text = await self._jobs.do(work)
                response.success, response.message = True, f"{name}: {text}"
            except RseaError as error:
                response.success, response.message = False, " ".join(str(error).split())
            self._node.get_logger().info(response.message)
            self._health.publish()
            return response

        self._node.create_service(Trigger, f"~/{name}", serve, callback_group=self._jobs.group)

    def _tell(self) -> None:
        """Log and publish what has changed: a fault, commands that were cut down."""
        fault, limited = now = self._guarded.fault, self._guarded.guard.limited
        before, self._told = self._told, now
        if fault is not None and fault != before[0]:
            self._node.get_logger().error(f"fault {fault}; torque zero until clear_fault or reboot")
            self._health.publish()
        if limited > before[1]:
            limits = self._guarded.guard.limits
            text = f"{limited} commands limited to {limits.torque:g} N m and {limits.slew:g} N m/s so far"
            self._node.get_logger().warning(text, throttle_duration_sec=1.0)

    def _fail(self, error: Exception) -> None:
        self._ended = " ".join(str(error).split())
        self._node.get_logger().error(self._ended)

    def _report(self) -> Report:
        if self._cycle is None or self._bench is None:
            return Report(ERROR if self._ended else OK, self._ended or "not configured", {})
        self._cycle.rest()
        fault: Fault | None = self._guarded.fault
        cycles = self._guarded.cycles
        lost = {words: cycles[name] for name, words in LOST.items()} if fault is None else {}
        report = self._bench.report(self._cycle, lost)
        values = {
            "active": self._guarded.enabled,
            "fault": fault or "none",
            "dead_host_protection": self._guarded.device.protection,
            "ft_source": self._guarded.ft_source,
            "limited_commands": self._guarded.guard.limited,
            **cycles,
            **report.values,
            **self._guarded.device.health(),
        }
        if fault is None:
            return Report(report.level, report.summary, values)
        besides = "" if report.level == OK else f"; {report.summary}"
        return Report(ERROR, f"fault {fault}{besides}", values)


def _hardware(values: dict[str, Any], health: Mapping[str, object]) -> str:
    """Return what diagnostics are about: which motor where, or which simulation."""
    if "motor" not in health:
        return f"{values['device']} {values['rig']}"
    sensor = f", F/T sensor at {values['ft_host']}" if values["ft_host"] else ""
    return f"{health['motor']}, ID {values['id']} on {values['port']}{sensor}"


def main() -> int:
    """Run the node."""
    return run_node("driver", TABLE, Driver, kind=LifecycleNode)


if __name__ == "__main__":
    sys.exit(main())
