"""Requests to a simulated bench, and the station that serves them."""

import json
import os
import select
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any, Protocol

from rsea_ros.hardware.peer.ft import SATURATED, ForceSensor, Misbehaviour
from rsea_ros.hardware.peer.peer_motor import KEPT, EmulatedMotor, Mechanism
from rsea_ros.hardware.peer.serial_line import EmulatedBus

Request = Mapping[str, Any]
LOWEST_VOLTAGE, VOLTAGE_ERROR = 18.0, 1


class LineRequests:
    """`{"do": NAME, …}`; the answer has `t`, the clock (ns) at which it was done, or `error`.

    misbehave (fields of Misbehaviour), set (items of the control table), alert (bits), sag (voltage in V),
    vanish, appear (name), reverse (ft: the sensor, not the motor), ft_gap (records), ft_restart, ft_rate
    (rate in Hz), ft_status (bits), model, firmware (number), watch (keep F/T records), torque (goal, whether
    it is on), log, pauses, quit.

    pauses: when the bench itself was held up until, and for how long, ns. `motor` in any request: its place
    on the line, 0 where it is not said.
    """

    def __init__(
        self,
        motors: Sequence[EmulatedMotor],
        bus: EmulatedBus,
        sensor: ForceSensor,
        wrong: Misbehaviour,
        inlet: int,
        outlet: int,
    ) -> None:
        self._motors, self._motor = motors, motors[0]
        self._bus, self._sensor, self._wrong = bus, sensor, wrong
        self.descriptor, self._outlet, self._text = inlet, outlet, b""
        self.pauses: deque[tuple[int, int]] = deque(maxlen=KEPT)
        self._does: dict[str, Callable[[int, Request], object]] = {
            "misbehave": self._misbehave, "set": self._set,
            "alert": lambda now, r: self._motor.shut_down(now, int(r["bits"])), "sag": self._sag,
            "vanish": lambda now, r: bus.vanish(), "appear": lambda now, r: bus.appear(r.get("name", "")),
            "ft_gap": lambda now, r: sensor.gap(int(r["records"])),
            "ft_restart": lambda now, r: sensor.restart(),
            "ft_rate": lambda now, r: sensor.set_rate(float(r["rate"])), "reverse": self._reverse,
            "ft_status": lambda now, r: setattr(sensor, "status", int(r.get("bits", SATURATED))),
            "model": self._model, "firmware": self._firmware,
            "watch": lambda now, r: setattr(sensor, "keep", bool(r.get("on", True))), "log": self._log,
            "pauses": lambda now, r: [pause for pause in self.pauses if pause[0] >= int(r.get("since", 0))],
            "torque": lambda now, r: [self._motor.acting_goal(), bool(self._motor.get("torque_enable"))],
        }  # fmt: skip

    def serve(self, now: int) -> bool:
        """Execute the requests that have arrived; return False at the end of input or on `quit`."""
        data = os.read(self.descriptor, 65536)
        self._text += data
        *lines, self._text = self._text.split(b"\n")
        for line in filter(None, lines):
            answer = self._do(now, line)
            if answer is None:
                return False
            self._tell(answer)
        return bool(data)

    def _tell(self, answer: dict[str, Any]) -> None:
        text = memoryview(json.dumps(answer).encode() + b"\n")
        while text:
            text = text[os.write(self._outlet, text) :]

    def _do(self, now: int, line: bytes) -> dict[str, Any] | None:
        try:
            request = json.loads(line)
            if request["do"] == "quit":
                return None
            self._motor = self._motors[int(request.pop("motor", 0))]
            return {"t": now, "result": self._does[request["do"]](now, request)}
        except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
            known = ", ".join(self._does)
            return {"error": f"{line.decode(errors='replace')}: {error!r}, expected one of {known}, quit"}

    def _misbehave(self, now: int, request: Request) -> None:
        known = {field.name for field in fields(Misbehaviour)} - {"done"}
        for name in set(request) - {"do"}:
            if name not in known:
                raise KeyError(name)
            setattr(self._wrong, name, request[name])

    def _set(self, now: int, request: Request) -> None:
        """Set items; a mode begins at rest unless its goal is set, too. The torque acts at once."""
        if "mode" in request:
            most = self._motor.model.registers["mode"].high
            if not 0 <= int(request["mode"]) <= most:
                raise ValueError(f"mode {request['mode']}, expected 0 to {most}")
            self._motor.hold(now)
        for name in set(request) - {"do"}:
            self._motor.put(name, int(request[name]))

    def _sag(self, now: int, request: Request) -> None:
        self._motor.put("voltage", round(10 * float(request["voltage"])))
        if float(request["voltage"]) < LOWEST_VOLTAGE:
            self._motor.shut_down(now, VOLTAGE_ERROR)

    def _reverse(self, now: int, request: Request) -> None:
        """Mount F/T sensor or motor the other way round; the motor counts from the same zero."""
        turned = self._sensor if request.get("ft") else self._motor
        turned.sign = -turned.sign

    def _model(self, now: int, request: Request) -> None:
        """Answer pings with another model number; the table stays."""
        self._motor.memory[0:2] = int(request["number"]).to_bytes(2, "little")

    def _firmware(self, now: int, request: Request) -> None:
        self._motor.memory[6] = int(request["number"])

    def _log(self, now: int, request: Request) -> dict[str, Any]:
        since = int(request.get("since", 0))
        return {
            "torque": [entry for entry in self._motor.history if entry[0] >= since],
            "replies": [(t, address, data.hex()) for t, address, data in self._bus.sent if t >= since],
            "records": [entry for entry in self._sensor.sent if entry[0] >= since],
            "ft_gone": self._sensor.gone,
            "misbehaved": self._wrong.done,
            "damaged_requests": self._bus.unknown,
        }


STILL = 10_000_000
"""ns between two turns from which on the bench itself was held up: it turns at least every TICK."""
TICK = 5_000_000
"""ns; the plant's steps until now are worked off whenever somebody looks, and at least so often."""


class Requests(Protocol):
    """Where requests come from."""

    descriptor: int
    pauses: deque[tuple[int, int]]

    def serve(self, now: int) -> bool:
        """Execute requests; return False when the bench shall end."""


class Station:
    """Runs until its requests say so. Clocks are monotonic, ns.

    Where the machine holds it up, it notes in the requests' `pauses` when that ended and how long it was: a
    real motor would not stop, and replies late for that reason are not the driver's fault.
    """

    def __init__(
        self,
        plants: Sequence[Mechanism],
        motors: Sequence[EmulatedMotor],
        bus: EmulatedBus,
        sensor: ForceSensor,
        requests: Requests,
    ) -> None:
        self._plants, self._motors, self._bus, self._sensor = plants, motors, bus, sensor
        self._requests = requests
        self._tick = 0

    def run(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        """Serve everybody."""
        turned = clock()
        while True:
            ready = self._wait(clock)
            now = clock()
            if now - turned > STILL:
                self._requests.pauses.append((now, now - turned))
            turned = now
            if self._bus.descriptor in ready:
                self._bus.serve(now)
            if self._sensor.descriptor in ready:
                self._sensor.serve(now)
            advanced = self._sensor.tick(now)
            self._bus.flush(now)
            for motor in self._motors:
                motor.serve(now)
            if now >= self._tick and not (advanced and len(self._plants) == 1):
                for plant in self._plants:
                    plant.read()
                advanced = True
            if advanced:
                self._tick = now + TICK
            if self._requests.descriptor in ready and not self._requests.serve(now):
                return

    def _wait(self, clock: Callable[[], int]) -> list[int]:
        due = min(filter(None, (self._tick, self._bus.next_due, self._sensor.next_due)), default=0)
        places = [self._sensor.descriptor, self._requests.descriptor]
        if self._bus.descriptor >= 0:
            places.append(self._bus.descriptor)
        ready, _, _ = select.select(places, (), (), max(0.0, (due - clock()) / 1e9))
        return ready
