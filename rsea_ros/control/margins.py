"""The loop, its margins, and its output impedance: the torque that a motion of the distal side makes.

    T = P u + H_T w_d,   w = P_w u + H_w w_d,   u = -(a T + b w) / N
    T / w_d = H_T - P (a H_T + b H_w) / D

w_d is the speed of the distal side, w that of the gear, a and b the law's actions, N and D of `returns`. H is
the bench without motor torque. A motor at rest leaves the spring: Z_s = K_s / s + b_s.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.control import law as laws
from rsea_ros.control.law import FT, VELOCITY, FeedbackLaw, FeedbackState, Gains, Sampled, feedback, z_of
from rsea_ros.control.uncertainty import BenchVariant, lags_of, lock, mode_of, variant_rig
from rsea_ros.model import outputs
from rsea_ros.model.equations import COORDINATES, D
from rsea_ros.model.outputs import Output
from rsea_ros.model.rig import Rig
from rsea_ros.model.transfer import frequency_response
from rsea_ros.records.record import ComplexArray, FloatArray


@dataclass(frozen=True)
class Margins:
    """crossover: the highest one, Hz. phase: deg. gain: dB, up or down. delay: samples.

    Each is the smallest over all crossings, inf where there is none. sensitivity: largest |1 / (1 + L)|.
    """

    crossover: float
    phase: float
    gain: float
    delay: float
    sensitivity: float


def margins(loop: ComplexArray, hz: FloatArray, period: float) -> Margins:
    """Return the margins of a loop from its response, by straight lines between its points."""
    crossings, at = _crossings(np.abs(loop) - 1.0, loop, hz)
    behind = np.angle(-crossings) % (2.0 * np.pi)  # rotated back by this angle it meets -1
    phases = np.degrees(np.abs(np.angle(-crossings)))
    turned, _ = _crossings(loop.imag, loop, hz)
    gains = np.abs(20.0 * np.log10(np.abs(turned[turned.real < 0.0])))
    return Margins(
        crossover=float(at.max(initial=0.0)),
        phase=float(phases.min(initial=np.inf)),
        gain=float(gains.min(initial=np.inf)),
        delay=float((behind / (2.0 * np.pi * at * period)).min(initial=np.inf)),
        sensitivity=float(np.max(1.0 / np.abs(1.0 + loop))),
    )


def least(several: list[Margins]) -> Margins:
    """Return the worst of each margin; crossover: the highest."""
    return Margins(
        max(m.crossover for m in several),
        min(m.phase for m in several),
        min(m.gain for m in several),
        min(m.delay for m in several),
        max(m.sensitivity for m in several),
    )


def encirclements(around: ComplexArray) -> FloatArray:
    """Return how often each row of 1 + L, shape (…, n), turns about zero, less the turn between its ends."""
    step = np.diff(np.angle(around), axis=-1)
    forth, back = (np.count_nonzero(beyond, axis=-1) for beyond in (step > np.pi, step < -np.pi))
    turns: FloatArray = np.abs(forth - back + 0.0 * step.sum(axis=-1))  # NaN where a response is none
    return turns


def _crossings(sign: FloatArray, loop: ComplexArray, hz: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Return the loop and the frequency where `sign` passes zero."""
    i = np.nonzero(sign[:-1] * sign[1:] < 0.0)[0]
    share = sign[i] / (sign[i] - sign[i + 1])
    return loop[i] + share * (loop[i + 1] - loop[i]), hz[i] + share * (hz[i + 1] - hz[i])


def actions(law: FeedbackLaw, hz: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return the law's responses to ft (1), velocity (N m s/rad) and applied torque (1).

    C + Q (1 + 1/z)/2,   k_w H + Q (J (1 - 1/z)/T + b (1 + 1/z)/2),   Q / z,   C = k_p + k_d D + k_i I
    """
    g, back = law.gains, 1.0 / z_of(law.period, hz)
    rate = (1.0 - law.rate_pole) / law.period * (1.0 - back) / (1.0 - law.rate_pole * back)
    slow = law.leak_gain * (1.0 + back) / (1.0 - law.leak_pole * back)
    slow = slow * (1.0 + law.rest_gain * (1.0 + back) / (1.0 - back))
    wash = 0.5 * (1.0 + law.wash_pole) * (1.0 - back) / (1.0 - law.wash_pole * back)
    q = law.q_gain * (1.0 + back) / (1.0 - law.q_pole * back)
    on_ft = g.k_p + g.k_d * rate + g.k_i * slow + 0.5 * q * (1.0 + back)
    explained = law.inertia * (1.0 - back) / law.period + 0.5 * law.damping * (1.0 + back)
    return on_ft, g.k_w * wash + q * explained, q * back


def link_response(
    law: FeedbackLaw, inertia: float, damping: float, corner: float, hz: FloatArray
) -> ComplexArray:
    """Return the law's response to the link's angle (N m/rad), with its delay of one sample (link.py)."""
    back, pole = 1.0 / z_of(law.period, hz), np.exp(-2.0 * np.pi * corner * law.period)
    rate = (1.0 - back) / law.period
    wanted = inertia * law.inertia * rate + 0.5 * damping * law.damping * (1.0 + back)
    action: ComplexArray = back * (1.0 - pole) / (1.0 - pole * back) * wanted * rate
    return action


def returns(
    law: FeedbackLaw, plant: ComplexArray, hz: FloatArray, path: ComplexArray | float = 1.0,
    current: ComplexArray | float = 1.0, acted: Sequence[ComplexArray] = (),
) -> tuple[ComplexArray, ComplexArray]:  # fmt: skip
    """Return the loop's memory N and D = N + the rest of the loop, shape (…, n): L = D / N - 1.

    plant: of `responses`, without the path; shape (4, …, n). path, current: from a command to the motor
    torque and to its measurement, beyond the one sample that is always present. N is 1 less the torque
    that is fed back; N / D is the sensitivity to a torque on the gear, 1 / D that to one on the command.
    acted: the `actions`, where they are known.
    """
    on_ft, on_velocity, memory = acted or actions(law, hz)
    back = 1.0 / z_of(law.period, hz)
    fed_back = 1.0 - back * current * memory
    whole = fed_back + back * path * (on_ft * plant[FT] + on_velocity * plant[VELOCITY])
    return np.broadcast_to(fed_back, whole.shape), whole


def closed_loop_matrix(law: FeedbackLaw, plant: Sampled, share: float = 1.0) -> FloatArray:
    """Return the matrix that takes bench and law from one sample to the next, without a desired torque.

    Its columns are the answers of `feedback` and `hold` to unit states. share: of the torque that acts.
    """
    n, size = len(plant.a), len(plant.a) + len(FeedbackState._fields)
    columns = [_step(law, plant, unit[:n], FeedbackState(*unit[n:]), share) for unit in np.eye(size)]
    return np.column_stack(columns)


def largest_pole(law: FeedbackLaw, plant: Sampled, share: float = 1.0) -> float:
    """Return the largest modulus of a closed-loop pole: stable below 1."""
    return float(np.abs(np.linalg.eigvals(closed_loop_matrix(law, plant, share))).max())


def _step(law: FeedbackLaw, plant: Sampled, x: FloatArray, s: FeedbackState, share: float) -> FloatArray:
    y = plant.c @ x
    ft, velocity = float(y[FT]), float(y[VELOCITY])
    torque, after = feedback(law, s, -ft, -velocity, ft, velocity)
    return np.concatenate([plant.a @ x + plant.b * s.newest, laws.hold(after, share * torque)])


@dataclass(frozen=True)
class OutputImpedance:
    """N m s/rad at hz, shape (n,): under control, with the motor off, with the motor at rest."""

    hz: FloatArray
    controlled: ComplexArray
    motor_off: ComplexArray
    spring: ComplexArray


@dataclass(frozen=True)
class Moved:
    """The locked rig's answer to the motor, shape (4, n), and without it to a moved distal side: torque and
    speed of the gear, per rad/s; the spring's impedance; all at hz. sensor: what the F/T sensor makes of the
    torque; path, current: as `returns` has them."""

    hz: FloatArray
    plant: ComplexArray
    torque: ComplexArray
    speed: ComplexArray
    spring: ComplexArray
    sensor: ComplexArray | float = 1.0
    path: ComplexArray | float = 1.0
    current: ComplexArray | float = 1.0

    def impedance(self, law: FeedbackLaw, on_link: ComplexArray | float = 0.0) -> ComplexArray:
        """Return T / w_d under a law, N m s/rad, shape (n,). on_link: of `linked`, N m/rad."""
        on_ft, on_velocity, _ = acted = actions(law, self.hz)
        sensed = self.plant.copy()
        sensed[FT] *= self.sensor
        _, whole = returns(law, sensed, self.hz, self.path, self.current, acted)
        commanded = (on_ft * self.sensor * self.torque + on_velocity * self.speed) / z_of(law.period, self.hz)
        commanded = commanded - on_link / (2j * np.pi * self.hz)
        opposed: ComplexArray = self.torque - self.plant[FT] * self.path * commanded / whole
        return opposed

    def ratio(self, law: FeedbackLaw, on_link: ComplexArray | float = 0.0) -> FloatArray:
        """Return |T / w_d| over that of the bare spring. on_link: as `impedance` has it."""
        return np.abs(self.impedance(law, on_link) / self.spring)


def distal_responses(rig: Rig, rate: float, hz: FloatArray) -> Moved:
    """Return the responses to a moved distal side of a rig, its housing clamped. hz: below half the rate."""
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    torque, speed = _without_motor(rig, hz, s)
    spring = -(rig["spring.stiffness"] / s + rig["spring.damping"])
    return Moved(hz, laws.responses(laws.sample_rig(lock(rig), rate), hz), torque, speed, spring)


def moved_bench(rig: Rig, rate: float, hz: FloatArray, case: BenchVariant) -> Moved:
    """Return what moving the distal side of a bench of the set does. hz: below half the rate."""
    path, current = lags_of(case, rate, hz)
    still = distal_responses(variant_rig(rig, case), rate, hz)
    return replace(still, sensor=mode_of(case.mode, hz), path=path, current=current)


def impedance(rig: Rig, rate: float, gains: Gains, hz: FloatArray) -> OutputImpedance:
    """Return the impedance of the distal side against a clamped housing. hz: below half the rate."""
    moved = distal_responses(rig, rate, hz)
    return OutputImpedance(hz, moved.impedance(laws.law_of(rig, rate, gains)), moved.torque, moved.spring)


def _without_motor(rig: Rig, hz: FloatArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Return torque at the sensor and speed of the gear over the speed of the distal side, no motor torque.

    Any inertia may be on the distal side: the torque that moves it cancels.
    """
    free = replace(rig.with_values({"spring_end.inertia": 1.0}), clamped=frozenset({"housing_end"}))
    distal = Output(np.zeros((3, COORDINATES)), np.zeros_like(outputs.position().d))
    distal.c[0, D] = 1.0
    measured = (outputs.end_torque(free, "spring_end"), outputs.position(), distal)
    torque, angle, turned = (frequency_response(free, output, hz, "distal") for output in measured)
    return torque / (s * turned), angle / turned
