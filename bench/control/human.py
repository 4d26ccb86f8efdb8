"""A human or a virtual load at the joint.

Linear, exact at the samples, without noise; the housing is clamped. The arm's numbers are those of an elbow:
0.1 kg m^2, 1 N m s/rad, 20 N m/rad (Hogan, IEEE Trans. Automatic Control 29, 1984; relaxed).

desired = -(K_v theta + D_v theta'),   theta = position - ft / K_s: where the distal side is

and what that is from outside, w the speed of the distal side:

    Z = Z_0 + G (K_v / s + D_v),   Z_0 = -T / w of the torque controller alone,   G = T / desired

A load that is passive cannot make the whole unstable as long as Re Z > 0 (Colgate, Hogan, Int. J. Control 48,
1988). In continuous time a series elastic actuator shows at most its own spring (Vallery et al., IEEE/RSJ
IROS 2007; Tagliamonte, Accoto, IEEE/ASME AIM 2014); sampled, with two samples to the end of a hold, every
K_v > 0 leaves passivity somewhere, and the question is from which frequency on.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import expm

from rsea_ros.control.controller import CORNER, ControllerSettings, Measurement, TorqueController
from rsea_ros.control.following import UNLIMITED
from rsea_ros.control.law import law_of, z_of
from rsea_ros.control.link import LinkShare
from rsea_ros.control.margins import distal_responses
from rsea_ros.control.prediction import AHEAD, SMOOTH, course, gains_of
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.model import outputs
from rsea_ros.model.equations import COORDINATES, PORTS, D
from rsea_ros.model.outputs import Output
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import read
from rsea_ros.records.record import ComplexArray, FloatArray

SMALLEST = 0.02
"""Hz, from which on passivity is looked at."""


def prediction_response(corner: float, period: float, hz: FloatArray) -> ComplexArray:
    """Return predicted over true torque at the end of the hold, trusted in full, at hz: 1 is no error."""
    g = gains_of(math.exp(-2.0 * math.pi * corner * period))
    z = z_of(period, hz)
    first = np.array([1.0, 0.0, 0.0])
    to_state = np.eye(3) - (np.eye(3) - np.outer(g, first)) @ course(1.0) / z[:, None, None]
    states = np.linalg.solve(to_state, np.broadcast_to(g.astype(complex)[:, None], (len(z), 3, 1)))[..., 0]
    rates = course(1.0)[0] * [1.0, AHEAD, AHEAD * AHEAD]
    response: ComplexArray = (1.0 + states[:, 1:] @ rates[1:]) / z**AHEAD
    return response


def smoothed_response(period: float, hz: FloatArray) -> ComplexArray:
    """Return the response of an untrusted torque at the end of the hold, at hz."""
    back = 1.0 / z_of(period, hz)
    pole = math.exp(-2.0 * math.pi * SMOOTH * period)
    response: ComplexArray = ((1.0 - pole) / (1.0 - pole * back)) ** 2 * back**AHEAD
    return response


@dataclass(frozen=True)
class Virtual:
    """K_v, N m/rad; D_v, N m s/rad."""

    stiffness: float
    damping: float

    def torque(self, reading: Measurement, velocity: float, k_s: float) -> float:
        """Return the desired torque, N m. velocity: of the distal side, rad/s."""
        return -self.stiffness * (reading.position - reading.ft / k_s) - self.damping * velocity


def felt_impedance(
    rig: Rig, design: ControllerDesign, virtual: Virtual, hz: FloatArray, *, trust: bool = True
) -> ComplexArray:
    """Return Z, N m s/rad, of the locked rig moved at its distal side, linear, at hz below half the rate.

    trust: whether the desired torque is predicted; else it comes through the low pass, two samples late.
    """
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    alone = -distal_responses(rig, design.rate, hz).impedance(law_of(rig, design.rate, design.gains))
    h = 1.0 / design.rate
    follows = prediction_response(CORNER, h, hz) if trust else smoothed_response(h, hz)
    whole: ComplexArray = alone + follows * (virtual.stiffness / s + virtual.damping)
    return whole


def passive_to(rig: Rig, design: ControllerDesign, virtual: Virtual) -> float:
    """Return the frequency from which on Re Z < 0, Hz, with the desired torque predicted or not, whichever is
    lower; inf where it never is, to 0.45 of the rate."""
    hz = np.geomspace(SMALLEST, 0.45 * design.rate, 400)
    real = [felt_impedance(rig, design, virtual, hz, trust=trust).real for trust in (True, False)]
    negative = np.min(real, axis=0) < 0.0
    return float(hz[np.argmax(negative)]) if negative.any() else math.inf


def stiffest(rig: Rig, design: ControllerDesign, damping: float, to: float) -> float:
    """Return the largest K_v, N m/rad, that keeps Re Z > 0 up to a frequency, Hz."""
    low, high = 0.0, 4.0 * rig["spring.stiffness"]
    for _ in range(30):
        middle = 0.5 * (low + high)
        kept = passive_to(rig, design, Virtual(middle, damping)) >= to
        low, high = (middle, high) if kept else (low, middle)
    return low


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
