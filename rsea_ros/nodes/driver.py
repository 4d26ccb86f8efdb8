"""driver: an actuator behind the Device interface, as a lifecycle node.

configure opens the device and starts the cycle: measurements are published, the torque is off. activate
switches it on, at zero, and lets commands through. deactivate, cleanup, shutdown, a signal and an exception
zero it and switch it off. A fault zeroes it until the service clear_fault or reboot; the node stays active.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, ManagedEntity, TransitionCallbackReturn

from msg_adapters.ros import Trigger
from rsea_ros.errors import RseaError
from rsea_ros.hardware.guarded import Guarded
from rsea_ros.hardware.limits import Fault
from rsea_ros.nodes._bench import Bench
from rsea_ros.nodes._cycle import SECOND, Cycle
from rsea_ros.nodes._devices import DEVICES, LIMITS, MOTOR, SENSOR, limits_of
from rsea_ros.nodes._health import ERROR, OK, Health, Report
from rsea_ros.nodes._parameters import Parameter
from rsea_ros.nodes._realtime import REALTIME, keep_time, usual_priority
from rsea_ros.nodes._run import run_node

TABLE = (
    Parameter("device", "simulated", "what to drive", choices=tuple(DEVICES)),
    Parameter("rate", 280.0, "cycles a second", "Hz", 10.0, 1000.0),
    Parameter("rig", "paper_high_impedance", "the bench: a name of config/rigs, or a file"),
    Parameter("seed", 0, "seed of the simulated sensors' noise", "", 0, 1_000_000_000),
    Parameter("autostart", False, "whether to configure and activate at once"),
    REALTIME,
    *MOTOR,
    *SENSOR,
    *LIMITS,
)


class Driver(ManagedEntity):
    """One device behind its limits, its cycle and its topics, from configure to cleanup."""

    def __init__(self, node: LifecycleNode, values: dict[str, Any]) -> None:
        self._node, self._values = node, values
        self._guarded = Guarded(DEVICES[values["device"]](values), limits_of(values), values["rate"])
        self._cycle: Cycle | None = None
        self._bench: Bench | None = None
        self._ended = ""
        self._told: tuple[Fault | None, int] = (None, 0)
        self._lock = threading.Lock()
        self._health = Health(node, self._report)
        self._offer("zero_ft", self._guarded.zero_ft)
        self._offer("clear_fault", lambda: self._alone(self._guarded.clear))
        self._offer("reboot", lambda: self._alone(self._guarded.reboot))
        node.add_managed_entity(self)
        if values["autostart"] and node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            node.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the device and begin to publish what it measures."""
        try:
            self._guarded.device.open()
        except (RseaError, OSError) as error:
            self._fail(error)
            return TransitionCallbackReturn.FAILURE
        self._ended = ""
        self._guarded.guard.clear()
        self._bench = Bench(self._node, strict=True, every_record=self._values["ft_all"])
        self._cycle = Cycle(self._values["rate"], self._step, catch_up=False)
        keep_time(self._node, self._cycle, self._values["realtime_priority"])
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Switch the torque on and let commands through, from the next one on; not with a fault latched."""
        try:
            self._alone(self._guarded.enable)
        except RseaError as error:
            self._node.get_logger().error(f"not activated: {error}")
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Zero torque, switched off; measurements go on."""
        try:
            self._alone(self._guarded.disable)
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
        self._cycle = self._bench = None

    def _step(self, stamp: int) -> None:
        """Write the command that is in force from this cycle on (its stamp rounded), read, publish."""
        bench = self._bench
        assert bench is not None
        try:
            with self._lock:
                bench.poll()
                bench.commands.take(stamp + round(0.5 * SECOND / self._values["rate"]))
                state = self._guarded.cycle(bench.commands.torque, bench.commands.age(time.time_ns()))
            if state is not None:
                bench.publish(state)
        except Exception:
            self._guarded.device.close()
            raise

    def _alone(self, work: Callable[[], None]) -> None:
        """Do something with the device between two cycles; commands from before it are forgotten."""
        with self._lock:
            work()
            if self._bench is not None:
                self._bench.commands.clear()

    def _offer(self, name: str, work: Callable[[], None]) -> None:
        """Offer a service that does some work, and answers with the error where it fails."""

        def serve(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                if self._cycle is None:
                    raise RseaError(f"{name}: the driver is not configured, expected it to be")
                work()
                response.success, response.message = True, f"{name}: done"
            except RseaError as error:
                response.success, response.message = False, " ".join(str(error).split())
            self._node.get_logger().info(response.message)
            self._health.publish()
            return response

        self._node.create_service(Trigger, f"~/{name}", serve)

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
        report = self._bench.report(self._cycle)
        values = {
            "active": self._guarded.enabled,
            "fault": fault or "none",
            "limited_commands": self._guarded.guard.limited,
            **self._guarded.cycles,
            **report.values,
            **self._guarded.device.health(),
        }
        level, summary = (report.level, report.summary) if fault is None else (ERROR, f"fault {fault}")
        return Report(level, summary, values)


def main() -> int:
    """Run the node."""
    return run_node("driver", TABLE, Driver, kind=LifecycleNode)


if __name__ == "__main__":
    sys.exit(main())
