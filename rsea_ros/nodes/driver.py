"""driver: an actuator behind the Device interface, as a lifecycle node.

configure opens the device and starts the cycle: measurements are published, the torque is zero. activate lets
commands through. deactivate, cleanup, shutdown, a fault of the device and a signal all command zero torque.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, ManagedEntity, TransitionCallbackReturn

from rsea_ros.errors import RseaError
from rsea_ros.hardware.device import Device
from rsea_ros.hardware.simulated import SimulatedDevice
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._bench import Bench
from rsea_ros.nodes._cycle import SECOND, Cycle
from rsea_ros.nodes._health import ERROR, OK, Health, Report
from rsea_ros.nodes._parameters import Parameter
from rsea_ros.nodes._run import run_node

Values = Mapping[str, Any]


def _simulated(values: Values) -> Device:
    return SimulatedDevice(load_rig(values["rig"]), values["rate"], seed=values["seed"])


DEVICES: Mapping[str, Callable[[Values], Device]] = {"simulated": _simulated}

TABLE = (
    Parameter("device", "simulated", "what to drive", choices=tuple(DEVICES)),
    Parameter("rate", 280.0, "cycles a second", "Hz", 10.0, 1000.0),
    Parameter("rig", "paper_high_impedance", "rig of the simulated device: a name of config/rigs, or a file"),
    Parameter("seed", 0, "seed of the simulated sensors' noise", "", 0, 1_000_000_000),
    Parameter("autostart", False, "whether to configure and activate at once"),
)


class Driver(ManagedEntity):
    """One device, its cycle and its topics, from configure to cleanup."""

    def __init__(self, node: LifecycleNode, values: dict[str, Any]) -> None:
        self._node, self._values = node, values
        self._device = DEVICES[values["device"]](values)
        self._cycle: Cycle | None = None
        self._bench: Bench | None = None
        self._active, self._fault = False, ""
        self._lock = threading.Lock()
        self._health = Health(node, self._report)
        node.add_managed_entity(self)
        if values["autostart"] and node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            node.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the device and begin to publish what it measures."""
        try:
            self._device.open()
        except (RseaError, OSError) as error:
            self._fail(error)
            return TransitionCallbackReturn.FAILURE
        self._fault = ""
        self._bench = Bench(self._node)
        self._cycle = Cycle(self._values["rate"], self._step, catch_up=False)
        self._cycle.start()
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let commands through, from the next one on."""
        if self._bench is not None:
            self._bench.commands.clear()
        self._active = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Command zero torque; measurements go on."""
        with self._lock:
            self._active = False
            if self._cycle is not None and self._cycle.error is None:
                self._device.write(0.0)
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Command zero torque, close the device, take the topics away."""
        self.close()
        return TransitionCallbackReturn.SUCCESS

    on_shutdown = on_error = on_cleanup

    def finished(self) -> bool:
        """Go back to unconfigured after a fault; otherwise run until stopped."""
        error = self._cycle.error if self._cycle is not None else None
        if error is not None:
            self._fail(error)
            if self._active:
                self._node.trigger_deactivate()
            self._node.trigger_cleanup()
        return False

    def conclude(self) -> None:
        """Leave nothing to do."""

    def close(self) -> None:
        """Zero torque, device closed, topics gone; also when there are none."""
        self._active = False
        if self._cycle is not None:
            self._cycle.stop()
        self._device.close()
        if self._bench is not None:
            self._bench.close()
        if self._cycle is not None:
            self._node.get_logger().info("torque zero, device closed")
        self._cycle = self._bench = None

    def _step(self, stamp: int) -> None:
        """Read, write the command that is in force from this cycle on (its stamp rounded), publish."""
        bench = self._bench
        assert bench is not None
        try:
            with self._lock:
                bench.poll()
                bench.commands.take(stamp + round(0.5 * SECOND / self._values["rate"]))
                state = self._device.read()
                self._device.write(bench.commands.torque if self._active else 0.0)
        except Exception:
            self._device.close()
            raise
        bench.publish(state)

    def _fail(self, error: Exception) -> None:
        self._fault = " ".join(str(error).split())
        self._node.get_logger().error(self._fault)

    def _report(self) -> Report:
        if self._cycle is None or self._bench is None:
            return Report(ERROR if self._fault else OK, self._fault or "not configured", {})
        report = self._bench.report(self._cycle)
        return report._replace(values={"active": self._active, **report.values})


def main() -> int:
    """Run the node."""
    return run_node("driver", TABLE, Driver, kind=LifecycleNode)


if __name__ == "__main__":
    sys.exit(main())
