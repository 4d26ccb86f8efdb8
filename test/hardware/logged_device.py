"""A device that logs its calls, and the guarded device made of it."""

from rsea_ros.hardware.device import NoReply, State
from rsea_ros.hardware.guarded import GuardedDevice
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.protection import BUS_WATCHDOG, Protection

LOST = NoReply("no reply")


class Log(Protection):
    """A protection that writes its beats to a log."""

    def __init__(self, kind, log):
        super().__init__(kind)
        self.log = log

    def beat(self, armed=None):
        self.log.append("beat" if armed is None else f"beat {armed}")


class Device:
    """A device that logs its calls. broken: by method, the errors of the next calls."""

    def __init__(self, kind=BUS_WATCHDOG):
        self.log, self.broken, self.during = [], {}, {}
        self.protection = Log(kind, self.log)
        self.reading = {"temperature": 30.0}

    def _did(self, what):
        self.log.append(what)
        if self.broken.get(what.split()[0]):
            error = self.broken[what.split()[0]].pop(0)
            if error is not None:
                raise error
        self.during.get(what.split()[0], lambda: None)()

    def read(self):
        self._did("read")
        return State(1, **{"position": 0.0, "velocity": 0.0, "motor_torque": 0.0, **self.reading})

    def write(self, torque):
        self._did(f"write {torque:g}")

    def __getattr__(self, name):
        if name not in {"open", "enable", "disable", "zero_ft", "recover", "reboot", "close"}:
            raise AttributeError(name)
        return lambda: self._did(name)


def guard(device):
    """Return a guarded device, open and enabled, with nothing in its log; 4 N m a cycle of soft start."""
    made = GuardedDevice(device, Limits(64.0, slew=1e9, soft_start=256.0), 64.0)
    made.open()
    made.enable()
    device.log.clear()
    return made


def cycles(joint, device, count, **broken):
    """Cycles with a torque. broken: by method, the errors of the next calls."""
    device.broken = {method: [*errors] for method, errors in broken.items()}
    for _ in range(count):
        joint.cycle(1.0, 0.0)
