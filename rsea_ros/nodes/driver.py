"""driver: an actuator behind the Device interface, or several joints of one bus, as a lifecycle node.

configure opens the device and starts the cycle: measurements are published, the torque is off. activate
switches it on, at zero, and lets commands through. deactivate, cleanup, shutdown, a signal and an exception
zero it and switch it off. A fault, and the service stop, zero it until the service clear_fault or reboot; the
node stays active.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, ManagedEntity, TransitionCallbackReturn

from rsea_ros.documents.wording import printable
from rsea_ros.errors import DeviceError, ParameterError, RseaError
from rsea_ros.hardware.device import Device
from rsea_ros.hardware.limits import CHANGEABLE
from rsea_ros.hardware.outside import EXTRA_PATH, options_of
from rsea_ros.nodes._bench_topics import COMMAND_TYPE, NAMES, SPRING_FRAME, Combined
from rsea_ros.nodes._cycle import REALTIME, Anchor, Cycle, keep_time, stop_keeping_time
from rsea_ros.nodes._devices import DEVICES, ENCODER, LIMITS, MOTOR, SAFETY, SENSOR, devices_of
from rsea_ros.nodes._drive import step
from rsea_ros.nodes._joint import DrivenJoint, Offer, stop_of
from rsea_ros.nodes._joints import JOINTS, Jobs, joint_table, joint_values
from rsea_ros.nodes._parameters import NodeParameter, let_change, live
from rsea_ros.nodes._run import Component, Program, SignalListener

TABLE = (
    NodeParameter("device", "simulated", f"what to drive: {', '.join(DEVICES)}, or one of RSEA_DEVICES"),
    NodeParameter("rate", 280.0, "cycles a second", "Hz", 10.0, 1000.0, whole=True),
    NodeParameter("rig", "paper_high_impedance", "the bench: a name of config/rigs, or a file"),
    NodeParameter("seed", 0, "seed of the simulated sensors' noise", "", 0, 1_000_000_000),
    NodeParameter("autostart", False, "whether to configure and activate at once", whole=True),
    NodeParameter(
        "resume", False, "whether its first command then may be a torque, as after a restart", whole=True
    ),
    *REALTIME,
    JOINTS,
    *SAFETY,
    *MOTOR,
    *ENCODER,
    *SENSOR,
    *live(LIMITS, CHANGEABLE),
    *NAMES,
    SPRING_FRAME,
    COMMAND_TYPE,
)
PATIENCE = 10.0
"""s that a reboot may take which is under way when the program ends."""
RETURN, POLL = 3.0, 0.02
"""s within which motors that are away at the end may come back, to be switched off; between two looks."""


class DriverNode(ManagedEntity, Program):
    """The joints and their cycle, from configure to cleanup. joints: one, or those of the parameter."""

    def __init__(self, node: LifecycleNode, values: dict[str, Any]) -> None:
        self._node, self._values = node, values
        if node.get_parameter("use_sim_time").value:
            raise ParameterError("parameter use_sim_time = true, expected false: the device keeps real time")
        self._named = named = [
            (name, joint | {"device_options": options_of(joint["device_options"])})
            for name, joint in joint_values(values)
        ]
        if any(joint["device"] not in DEVICES for _, joint in named) and (
            files := os.environ.get(EXTRA_PATH)
        ):
            text = f"{EXTRA_PATH}={printable(files)}: code from there runs in this node"
            node.get_logger().warning(text)
        devices, self._buses = devices_of([joint for _, joint in named], DEVICES)
        self._jobs, self._alarm = Jobs(node), SignalListener(self._halt)
        self._offers: list[Offer] = []
        self.joints = [
            DrivenJoint(node, self._jobs, name, joint, device, self._offers)
            for (name, joint), device in zip(named, devices, strict=True)
        ]
        if named[0][0]:
            self._offers += [
                stop_of(node, self._jobs, "stop", self.joints, self._offers, lambda: None),
                Offer(node, self._jobs, "clear_fault", self._clear_faults, lambda: None),
            ]
        self._cycle: Cycle | None = None
        self._combined: Combined | None = None
        node.add_managed_entity(self)
        let_change(node, TABLE, self._change)
        self._changed = self._is_open = False
        self._zero_first = values["autostart"] and not values["resume"]
        if values["autostart"] and node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            node.trigger_activate()
        self._zero_first = False

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the devices and begin to publish their measurements."""
        anchor = Anchor()
        for joint in self.joints:
            try:
                self._renew_devices()
                joint.open(anchor)
            except (RseaError, OSError) as error:
                joint.fail(error)
                self._close_devices()
                self._take_topics_away()
                return TransitionCallbackReturn.FAILURE
        if self.joints[0].part:
            self._combined = Combined(self._node, [joint.part for joint in self.joints])
        self._cycle = Cycle(self._values["rate"], self._step, catch_up=False, anchor=anchor)
        for joint in self.joints:
            joint.runs_in(self._cycle)
        keep_time(self._node, self._cycle, self._values)
        self._is_open = True
        return TransitionCallbackReturn.SUCCESS

    def _renew_devices(self) -> None:
        """Make the devices of changed limits, which a device checks when it is opened."""
        if self._changed:
            devices, self._buses = devices_of([joint for _, joint in self._named], DEVICES)
            for joint, device in zip(self.joints, devices, strict=True):
                joint.guarded.device = device
            self._changed = False

    def _change(self, values: dict[str, Any]) -> None:
        """Take new limits of one joint: lower ones act in the next cycle, and none is raised under torque."""
        parts = {name.rpartition(".")[0] for name in values}
        joints = [joint for joint in self.joints if {joint.part} == parts]
        if not joints:
            names = ", ".join(joint.part for joint in self.joints)
            raise ParameterError(f"{', '.join(values)}: expected limits of one joint at once, of {names}")
        joints[0].change({name.rpartition(".")[2]: value for name, value in values.items()})
        self._changed = self._changed or self._cycle is None

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Switch the torque on and let commands through, from the next one on; not with a fault latched."""
        if self._cycle is None:
            self._node.get_logger().error("not activated: closed while a motor was away, clean up again")
            return TransitionCallbackReturn.FAILURE
        try:
            for joint in self.joints:
                joint.enable(zero_first=self._zero_first)
        except RseaError as error:
            self._node.get_logger().error(joint.with_name(f"not activated: {error}"))
            self._disable([each for each in self.joints if each.guarded.enabled])
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Zero torque, switched off; measurements go on."""
        self._disable(self.joints)
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Command zero torque, close the device, take the topics away. Fails while a motor is away."""
        try:
            self.close()
        except DeviceError as error:
            self._node.get_logger().fatal(f"{error}")
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    on_shutdown = on_error = on_cleanup

    def is_finished(self) -> bool:
        """Report faults; return to unconfigured when the cycle has ended with an exception.

        The executor's next work begins between two cycles.
        """
        for joint in self.joints:
            joint.follow()
        if self._cycle is not None:
            self._cycle.rest()
        error = self._cycle.error if self._cycle is not None else None
        if error is not None:
            for joint in self.joints:
                joint.fail(error)
            if any(joint.guarded.enabled for joint in self.joints):
                self._node.trigger_deactivate()
            self._node.trigger_cleanup()
        return False

    def close(self) -> None:
        """Zero torque, devices closed, topics removed; also without any. Raises DeviceError: a motor away."""
        for joint in self.joints:
            joint.guarded.interlock.disable()
        self._jobs.join(PATIENCE)
        with ExitStack() as kept:  # each whatever the one before raises
            kept.callback(self._take_topics_away)
            if self._cycle is not None:
                kept.callback(stop_keeping_time, self._values)
            kept.callback(self._close_devices)
            if self._cycle is not None:
                self._cycle.stop()
        if self._is_open:
            self._node.get_logger().info("torque zero, device closed")
        self._is_open = False

    def _take_topics_away(self) -> None:
        for joint in self.joints:
            joint.close()
        if self._combined is not None:
            self._combined.close()
        self._cycle = self._combined = None

    def _close_devices(self) -> None:
        """Close every device whatever one raises; all torques are zero before the first, slow, close."""
        end, away = time.monotonic() + RETURN, list[str]()
        with ExitStack() as kept:
            for joint in reversed(self.joints):
                kept.callback(_close, joint.guarded.device, end, away)
            if self._cycle is not None and len(self.joints) > 1:
                self._zero()
        if away:
            raise DeviceError("; ".join(away))

    def _zero(self) -> None:
        for joint in self.joints:
            with suppress(DeviceError):
                joint.guarded.device.write(0.0)
        for bus in self._buses:
            bus.send()

    def _disable(self, joints: Sequence[DrivenJoint]) -> None:
        """Zero torque and switch off, whatever one of them answers."""
        for joint in joints:
            try:
                joint.guarded.disable()
            except RseaError as error:
                self._node.get_logger().error(joint.with_name(f"while deactivating: {error}"))

    def _halt(self) -> None:
        """End the torque with the next cycle, since the process is to end."""
        for joint in self.joints:
            joint.guarded.interlock.halted = True

    def _step(self, stamp: int) -> None:
        """Run a cycle of the devices and publish the readings."""
        drives = [joint.drive for joint in self.joints if joint.drive is not None]
        try:
            states = step(drives, stamp, self._buses)
            for joint, state in zip(self.joints, states, strict=True):
                if state is not None:
                    joint.publish(state)
            if self._combined is not None:
                self._combined.publish(states, drives[0].anchor.shift)
        except Exception:
            self._close_devices()
            raise

    def _clear_faults(self, asked: int) -> str:
        """Clear every joint's fault; one that cannot be cleared does not affect the others.

        A joint waits for those before it, and may be stopped meanwhile: that is later than this request.
        """
        done, failed = [], []
        for joint in self.joints:
            try:
                done.append(f"{joint.part} {joint.clear_fault(asked)}")
            except RseaError as error:
                failed.append(f"{joint.part}: {error}")
        if failed:
            raise DeviceError("; ".join((*failed, *done)))
        return ", ".join(done)


def _close(device: Device, end: float, away: list[str]) -> None:
    """Close a device, again until an instant (s) where it is away with its torque on; then add its words."""
    while True:
        try:
            return device.close()
        except DeviceError as error:
            if time.monotonic() > end:
                return away.append(f"{error}")
        time.sleep(POLL)


NODE = Component(
    "driver", TABLE, DriverNode, kind=LifecycleNode, more=lambda given: joint_table(TABLE, given)
)
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
