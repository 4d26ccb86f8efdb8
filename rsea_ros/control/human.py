"""The output held by a human: an arm that a muscle shakes, and the impedance that it feels, measured.

Linear, exact at the samples, without noise; the housing is clamped. The arm's numbers are those of an elbow:
0.1 kg m^2, 1 N m s/rad, 20 N m/rad (Hogan, IEEE Trans. Automatic Control 29, 1984; relaxed).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from rsea_ros.control.controller import Measurement, TorqueController
from rsea_ros.control.following import UNLIMITED
from rsea_ros.control.link import LinkShare
from rsea_ros.control.settings import ControllerSettings
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.control.virtual import Virtual
from rsea_ros.model import outputs
from rsea_ros.model.equations import COORDINATES, PORTS, D
from rsea_ros.model.outputs import Output
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import read
from rsea_ros.records.record import ComplexArray, FloatArray

ARM = {"inertia": 0.1, "damping": 1.0, "stiffness": 20.0}
"""kg m^2, N m s/rad, N m/rad."""
MUSCLE, PERIODS, WAIT = 1.0, 8.0, 1.5
"""N m; periods that are read; s before them."""


class Held:
    """A rig whose distal side a human holds, one sample at a time."""

    def __init__(self, rig: Rig, rate: float) -> None:
        """rate: Hz."""
        arm = rig.with_values({f"spring_end.{name}": value for name, value in ARM.items()})
        bench = replace(arm, clamped=frozenset({"housing_end"}))
        system = state_space(bench)
        n = len(system.a)
        generator = np.zeros((n + 2, n + 2))
        ports = [PORTS.index("gear"), PORTS.index("distal")]
        generator[:n] = np.column_stack([system.a, system.b[:, ports]])
        held = expm(generator / rate)
        self._a, self._b, self._x = held[:n, :n], held[:n, n:], np.zeros(n)
        angle = outputs.position()
        distal = Output(np.zeros((3, COORDINATES)), np.zeros_like(angle.d))
        distal.c[1, D] = 1.0
        speed = Output(np.roll(angle.c, 1, axis=0), angle.d)
        wanted = (outputs.end_torque(bench, "spring_end"), speed, angle, distal, outputs.link())
        self._c = np.vstack([read(system, output)[0] for output in wanted])

    def step(self, torque: float, muscle: float) -> tuple[Measurement, float]:
        """Hold both torques (N m) for a sample; return the reading and the distal speed, rad/s."""
        self._x = self._a @ self._x + self._b @ np.array([torque, muscle])
        ft, velocity, position, distal, link = (float(y) for y in self._c @ self._x)
        return Measurement(ft, velocity, position, torque, link=link), distal


def measure_impedance(
    rig: Rig, design: ControllerDesign, virtual: Virtual, hz: FloatArray, link: LinkShare | None = None
) -> ComplexArray:
    """Return Z, N m s/rad, that a muscle's sine feels at each frequency, Hz: the code that runs."""
    return np.array([_measure_line(rig, design, virtual, float(f), link) for f in hz])


def _measure_line(
    rig: Rig, design: ControllerDesign, virtual: Virtual, hz: float, link: LinkShare | None
) -> complex:
    rate, k_s = design.rate, rig["spring.stiffness"]
    bench = Held(rig, rate)
    settings = ControllerSettings(learn=False)
    controller = TorqueController(rig, rate, design.gains, limits=UNLIMITED, link=link, settings=settings)
    pending, n = 0.0, round((WAIT + max(PERIODS / hz, 0.5)) * rate)
    rows = np.empty((n, 2))
    reading, distal = bench.step(0.0, 0.0)
    for k in range(n):
        rows[k] = reading.ft, distal
        command = controller.step(reading, virtual.torque(reading, distal, k_s))
        muscle = MUSCLE * np.sin(2.0 * np.pi * hz * k / rate)
        reading, distal = bench.step(pending, float(muscle))
        pending = command
    t = np.arange(n) / rate
    turn = np.exp(-2j * np.pi * hz * t) * (t >= WAIT)
    ft, speed = turn @ rows
    return complex(-ft / speed)
