"""A device from outside the package: two encoders, no F/T sensor; RSEA_DEVICES names this file in tests."""

from __future__ import annotations

import os
import socket
import time

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import State
from rsea_ros.hardware.outside import DeviceKind
from rsea_ros.hardware.protection import NONE, Protection, Supervised

STOP = b"stop\n"


class Toy:
    """A motor at the far end of a socket pair; its spring is deflected by torque / 1000 N m/rad."""

    def __init__(self, values):
        options = values["device_options"]
        self._supervised = options.get("supervised") == "yes"
        self._watchdog, self._boot = values["watchdog"], float(options.get("boot", 0.0))
        self.torque, self.on, self.opened = 0.0, False, False
        self.protection = Protection(NONE)
        self.deflection_known = True
        self.measured = {"temperature": 30.0, "current": 0.0, "voltage": 24.0}
        self.measured.pop(options.get("blind"), None)

    def open(self):
        self.near, self.far = socket.socketpair()
        self.opened = True
        if self._supervised:
            self.protection = Supervised(self._watchdog)
            self.protection.guard(self.near.fileno(), [STOP])

    def enable(self):
        self.torque, self.on = 0.0, True

    def read(self):
        if not self.opened:
            raise DeviceError("toy: not open")
        deflection = self.torque / 1000.0 if self.deflection_known else float("nan")
        return State(
            1, 3.0 + self.torque / 1000.0, 0.0, self.torque, deflection=deflection, **self.measured
        )

    def write(self, torque):
        self.torque = torque

    def disable(self):
        self.torque, self.on = 0.0, False

    def zero_ft(self):
        """Do nothing: there is no sensor."""

    def recover(self):
        """Do nothing: the toy is always ready."""

    def reboot(self):
        self.disable()
        time.sleep(self._boot)

    def health(self):
        return {"toy": os.getpid()}

    def close(self):
        self.disable()
        if self._supervised and self.opened:
            self.protection.release(safe=True)
        if self.opened:
            self.near.close()
            self.far.close()
        self.opened = False


DEVICE = DeviceKind("toy", Toy, feels=True)
