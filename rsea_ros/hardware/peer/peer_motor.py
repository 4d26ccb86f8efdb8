"""A simulated motor and a simulated encoder."""

import math
from collections import deque
from typing import Protocol

from rsea_ros.hardware.device import State
from rsea_ros.hardware.peer.registers import EEPROM, ENCODER, MODELS, READ_ONLY, TABLE_SIZE

FAILED, UNKNOWN, RANGE, LENGTH, LIMIT, ACCESS = 1, 2, 4, 5, 6, 7
TORQUE_MODE, VELOCITY_MODE, PWM_MODE = 0, 1, 16
VELOCITY_BAND, POSITION_BAND = 0.2, 0.05
"""rad/s, rad off the goal at which the loops of the other modes make all of their torque."""
WATCHDOG_UNIT = 20_000_000
"""ns"""
TRIPPED = -1
FIRMWARE = 45
KEPT = 60_000
"""Entries of each log: a minute at 1 kHz. A bench that runs for days does not grow."""


class Mechanism(Protocol):
    """The mechanics: advance to now and measure; hold a torque (N m) from now on."""

    def read(self) -> State:
        """Return the newest measurement."""

    def write(self, torque: float) -> None:
        """Hold a torque."""


class EmulatedMotor:
    """One motor. torque_constant: N m at the output per A, 0: its model's. origin: counts at 0 rad.

    sign: −1 where it is mounted the other way round, so that all it makes and measures is reversed.
    history: every write to it, as (clock in ns, `acting_goal`, whether torque is on), the newest `kept`; also
    where a torque begins or ends by itself, in other modes than that of torque.
    """

    def __init__(
        self,
        number: int,
        plant: Mechanism,
        torque_constant: float = 0.0,
        origin: int = 1234,
        kept: int = KEPT,
    ) -> None:
        self.model, self._plant = MODELS.get(number, ENCODER), plant
        self._constant, self._origin = torque_constant or self.model.constant, origin
        self.memory = bytearray(TABLE_SIZE)
        self.history: deque[tuple[int, int, bool]] = deque(maxlen=kept)
        self._touched, self.sign = 0, 1
        for name, register in self.model.registers.items():
            self.put(name, register.start)
        self.memory[0:2] = number.to_bytes(2, "little")
        self.memory[6] = FIRMWARE

    def get(self, name: str) -> int:
        """Return an item, signed."""
        register = self.model.registers[name]
        raw = self.memory[register.address : register.address + register.size]
        return int.from_bytes(raw, "little", signed=register.signed)

    def put(self, name: str, value: int) -> None:
        """Set an item without the rules for hosts."""
        register = self.model.registers[name]
        modulus = 1 << 8 * register.size
        data = (int(value) % modulus).to_bytes(register.size, "little")
        self.memory[register.address : register.address + register.size] = data

    @property
    def rate(self) -> int:
        """The number of its bit rate; 0 where it has none."""
        return self.get("baud") if "baud" in self.model.registers else 0

    @property
    def alert(self) -> bool:
        """Whether the hardware error status is set."""
        return self.get("hardware_error") != 0

    def serve(self, now: int) -> None:
        """Look after the bus watchdog; a tripped one takes the torque away until it is set to 0."""
        armed = self.get("watchdog") if "watchdog" in self.model.registers else 0
        if armed > 0 and now - self._touched > armed * WATCHDOG_UNIT:
            self.put("watchdog", TRIPPED)
            self.put("goal", 0)
            self._act(now)
        elif self.get("mode") != TORQUE_MODE and self.get("torque_enable"):
            self._plant.write(self.sign * self.torque())
            if not self.history or (self.history[-1][1] != 0) != (self.acting_goal() != 0):
                self._act(now)

    def hold(self, now: int) -> None:
        """Begin in another mode, as after power-on: at rest, where it stands."""
        self._measure(now)
        for name, value in (("goal_position", self.get("position")), ("goal_velocity", 0), ("goal_pwm", 0)):
            if name in self.model.registers:
                self.put(name, value)

    def read(self, now: int, address: int, length: int) -> tuple[int, bytes]:
        """Return error code and bytes, with measurements updated."""
        self._touched = now
        if not 0 < length <= TABLE_SIZE - address:
            return LENGTH, b""
        self._measure(now)
        return 0, bytes(self.memory[address : address + length])

    def write(self, now: int, address: int, data: bytes) -> int:
        """Write bytes over whole items; return the error code. Nothing is written when one is not allowed."""
        self._touched = now
        items, at = [], address
        while at < address + len(data):
            name = next((n for n, r in self.model.registers.items() if r.address == at), "")
            if not name:
                return ACCESS
            register = self.model.registers[name]
            items.append((name, data[at - address : at - address + register.size]))
            at += register.size
        if at != address + len(data):
            return LENGTH
        error = next(filter(None, (self._refusal(name, raw) for name, raw in items)), 0)
        for name, raw in items if not error else ():
            register = self.model.registers[name]
            self.memory[register.address : register.address + register.size] = raw
            self._act(now)
        return error

    def _refusal(self, name: str, raw: bytes) -> int:
        register = self.model.registers[name]
        value = int.from_bytes(raw, "little", signed=register.signed)
        on = "torque_enable" in self.model.registers and self.get("torque_enable")
        if register.access is READ_ONLY or (register.access is EEPROM and on):
            return ACCESS
        if name == "torque_enable" and value and self.alert:
            return ACCESS
        if not register.low <= value <= register.high or (name == "goal" and self._is_tripped()):
            return RANGE
        return LIMIT if name == "goal" and abs(value) > self.get("torque_limit") else 0

    def _is_tripped(self) -> bool:
        return "watchdog" in self.model.registers and self.get("watchdog") == TRIPPED

    def shut_down(self, now: int, bits: int) -> None:
        """Set hardware errors; those that the shutdown item names take the torque away until a reboot."""
        self.put("hardware_error", self.get("hardware_error") | bits)
        if bits & self.get("shutdown"):
            self.put("torque_enable", 0)
        self._act(now)

    def reboot(self, now: int) -> None:
        """Restart: RAM as after power-on, EEPROM kept, torque off."""
        for name, register in self.model.registers.items():
            if register.access is not EEPROM:
                self.put(name, register.start)
        self._act(now)

    def torque(self) -> float:
        """Return the torque that acts, N m: in other modes that of a loop which obeys no goal current."""
        if not self.get("torque_enable") or self._is_tripped():
            return 0.0
        unit, mode = self.model.ampere * self._constant, self.get("mode")
        if mode == TORQUE_MODE:
            return self.get("goal") * unit
        if mode == PWM_MODE:
            share = self.get("goal_pwm") / self.model.registers["goal_pwm"].high
        elif mode == VELOCITY_MODE:
            wanted = self.get("goal_velocity") * self.model.radian_per_second
            share = (wanted - self._motion()[1]) / VELOCITY_BAND
        else:
            position, velocity, _ = self._motion()
            turn = 2 * math.pi / self.model.counts_per_turn
            goal = (self.get("goal_position") - self._origin - self.get("homing_offset")) * turn
            share = (goal - position) / POSITION_BAND - velocity / (10.0 * VELOCITY_BAND)
        return max(-1.0, min(1.0, share)) * self.get("torque_limit") * unit

    def acting_goal(self) -> int:
        """Return the goal current in counts; in another mode the one that would make the torque that acts."""
        if self.get("mode") == TORQUE_MODE or not self.get("torque_enable"):
            return self.get("goal")
        return round(self.torque() / self._constant / self.model.ampere)

    def _act(self, now: int) -> None:
        entry = (now, self.acting_goal(), bool(self.get("torque_enable")))
        self.history.append(entry)
        self._plant.write(self.sign * self.torque())

    def _motion(self) -> tuple[float, float, float]:
        """Return position, velocity and torque as it counts them: rad, rad/s, N m."""
        state = self._plant.read()
        return self.sign * state.position, self.sign * state.velocity, self.sign * state.motor_torque

    def _measure(self, now: int) -> None:
        model, (position, velocity, torque) = self.model, self._motion()
        counts = round(position / (2 * math.pi) * model.counts_per_turn)
        self.put("position", self._origin + self.get("homing_offset") + counts)
        self.put("velocity", round(velocity / model.radian_per_second))
        self.put("current", round(torque / self._constant / model.ampere))
        if "tick" in model.registers:
            self.put("tick", now // 1_000_000 % 32768)


IDENTITY = 100


class EmulatedEncoder(EmulatedMotor):
    """A device of the bus whose position is the deflection of the plant's spring."""

    def __init__(self, plant: Mechanism, origin: int = -777, kept: int = 0) -> None:
        super().__init__(ENCODER.number, plant, origin=origin, kept=kept)
        self.put("id", IDENTITY)

    def serve(self, now: int) -> None:
        """Do nothing: it has no torque that could be taken away."""

    def torque(self) -> float:
        """Return none."""
        return 0.0

    def _act(self, now: int) -> None:
        """Do nothing."""

    def _measure(self, now: int) -> None:
        turns = self.sign * self._plant.read().deflection / (2 * math.pi)
        counts = round(turns * self.model.counts_per_turn)
        self.put("position", self._origin + self.get("homing_offset") + counts)
