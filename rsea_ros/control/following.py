"""How torque follows small sines and a step: gain, phase, motor torque, rise and settling.

Sines are followed one frequency at a time, so that they show the real controller, its prediction
with its trust included, unlike an impulse: above the predicted band the torque comes two samples late.
"""

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.control.controller import ControllerSettings, Measurement, TorqueController, TorqueLimits
from rsea_ros.control.synthesis import ControllerDesign
from rsea_ros.control.uncertainty import lock
from rsea_ros.errors import ParameterError, check_kind, check_rate
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import Plant, PlantSample
from rsea_ros.records.record import ComplexArray, FloatArray, torques_from


@dataclass(frozen=True)
class ControlTrace:
    """One run: t (s), desired, ft and command (N m), velocity (rad/s), all at the samples, shape (n,)."""

    t: FloatArray
    desired: FloatArray
    ft: FloatArray
    command: FloatArray
    velocity: FloatArray

    def __repr__(self) -> str:
        """Return the size of the run in one line."""
        most = float(np.abs(self.command).max())
        return f"ControlTrace({len(self.t)} samples, {self.t[-1]:g} s, at most {most:.3g} N·m)"

    def error(self, settle: float = 0.0) -> float:
        """Return the RMS of ft - desired from `settle` (s) on, over that of desired."""
        late = self.t >= settle
        wanted = self.desired[late]
        return float(np.sqrt(np.mean((self.ft[late] - wanted) ** 2) / np.mean(wanted**2)))


def closed_loop(
    rig: Rig,
    rate: float,
    controller: TorqueController,
    desired: FloatArray,
    *,
    noise: bool = True,
    late: int = 0,
) -> ControlTrace:
    """Run a controller on a simulated rig from rest. desired: N m at the samples, shape (n,).

    A command that is computed at a sample acts from the next one on: one sample of delay. late: samples
    more. Raises ParameterError for a controller of another rate, and for arguments of another kind.
    """
    check_kind("rig", rig, Rig, "a Rig (rsea.load_rig)")
    check_rate(rate)
    check_kind("controller", controller, TorqueController, "a TorqueController")
    desired = torques_from("desired", desired, 1)
    if controller.rate != rate:
        raise ParameterError(f"rate = {rate} Hz, expected that of the controller, {controller.rate} Hz")
    plant = Plant(rig, rate, noise=noise)
    sample = plant.step(0.0)
    pending, rows = [0.0] * (1 + late), np.empty((len(desired), 3))
    controller.start(reading(sample), float(desired[0]))
    for k, wanted in enumerate(desired):
        command = controller.step(reading(sample), float(wanted))
        rows[k] = sample.ft, command, sample.velocity
        sample = plant.step(pending.pop(0))
        pending.append(command)
    return ControlTrace(np.arange(len(desired)) / rate, desired, rows[:, 0], rows[:, 1], rows[:, 2])


def reading(sample: PlantSample) -> Measurement:
    """Return what a controller reads of a sample."""
    link = sample.position - sample.deflection
    return Measurement(sample.ft, sample.velocity, sample.position, sample.motor_torque, link=link)


UNLIMITED = TorqueLimits(torque=1e6, slew=1e12, ramp=0.0)
SINES = (1.0, 2.0, 3.0, 5.0, 10.0, 15.0, 20.0, 27.0, 35.0, 50.0, 70.0, 120.0, 200.0, 400.0)
"""Hz, of which those below HIGHEST of the rate are tried."""
HIGHEST = 0.46
PERIODS, FEW, WAIT, BAND = 5, 2, 0.7, 0.05
STEP = 5.0
"""N m: a step that the motor's limits hardly meet."""


@dataclass(frozen=True)
class Following:
    """T_d / desired and motor torque / desired at hz, shape (n,), as complex and as magnitude."""

    hz: FloatArray
    torque: ComplexArray
    motor: FloatArray

    @property
    def bandwidth(self) -> float:
        """Where it first falls below -3 dB, Hz, between the sines on a straight line over log f; inf where it
        does not, to the highest frequency looked at."""
        return fall(self.hz, self.gain)

    @property
    def gain(self) -> FloatArray:
        """|T_d / desired|, dB, shape (n,)."""
        return np.asarray(20.0 * np.log10(np.abs(self.torque)))

    def gain_at(self, hz: FloatArray) -> FloatArray:
        """Return the gain, dB, between the sines, shape of hz."""
        return np.interp(np.log(hz), np.log(self.hz), self.gain)

    @property
    def phase(self) -> FloatArray:
        """The phase of T_d / desired, deg, shape (n,), continuous from the sine that is followed best.

        That one is near 0. Slower ones, which a free load may leave to feedback, have any phase within 180.
        """
        angle, best = np.angle(self.torque), int(np.argmin(np.abs(self.torque - 1.0)))
        return np.asarray(np.degrees(np.concatenate([angle[:best], np.unwrap(angle[best:])])))

    @property
    def peak(self) -> float:
        """The largest gain, dB."""
        return float(self.gain.max())

    def motor_at(self, hz: float) -> float:
        """Return the motor torque per N m, between the frequencies."""
        return float(np.interp(hz, self.hz, self.motor))


def fall(hz: FloatArray, gain: FloatArray) -> float:
    """Return where a gain (dB, shape (n,)) first falls below -3 dB, Hz; inf where it does not."""
    over = gain + 3.0
    falls = np.nonzero((over[:-1] >= 0.0) & (over[1:] < 0.0))[0]
    if not len(falls):
        return math.inf if over[-1] >= 0.0 else 0.0
    k = int(falls[0])
    share = over[k] / (over[k] - over[k + 1])
    return float(hz[k] * (hz[k + 1] / hz[k]) ** share)


@dataclass(frozen=True)
class Step:
    """rise: s, from 10 to 90 %. overshoot: part of the step. settling: s, until it stays within 5 %."""

    t: FloatArray
    ft: FloatArray
    rise: float
    overshoot: float
    settling: float


def follow(
    true: Rig, model: Rig, design: ControllerDesign, *, late: int = 0, learn: bool = True
) -> Following:
    """Follow sines on a bench without noise and limits; the controller does not know its load."""
    hz = np.array([f for f in SINES if f < HIGHEST * design.rate])
    responses = [_sine(true, lock(model), design, float(f), late, learn) for f in hz]
    return Following(hz, np.array([t for t, _ in responses]), np.array([m for _, m in responses]))


def _sine(
    true: Rig, model: Rig, design: ControllerDesign, hz: float, late: int, learn: bool
) -> tuple[complex, float]:
    rate = design.rate
    n = round((WAIT + max((PERIODS if hz > FEW else FEW) / hz, 0.25)) * rate)
    wanted = np.sin(2.0 * np.pi * hz * np.arange(n) / rate)
    settings = ControllerSettings(learn=learn)
    controller = TorqueController(model, rate, design.gains, limits=UNLIMITED, settings=settings)
    run = closed_loop(true, rate, controller, wanted, noise=False, late=late)
    turn = np.exp(-2j * np.pi * hz * run.t) * (run.t >= WAIT)
    scale = np.sum(wanted * turn)
    return complex(np.sum(run.ft * turn) / scale), float(abs(np.sum(run.command * turn) / scale))


def step_response(true: Rig, model: Rig, design: ControllerDesign, *, late: int = 0) -> Step:
    """Return the answer to a step from rest, within the motor's limits, without noise."""
    rate = design.rate
    wanted = np.where(np.arange(round(1.5 * rate)) < 0.3 * rate, 0.0, STEP)
    controller = TorqueController(lock(model), rate, design.gains)
    run = closed_loop(true, rate, controller, wanted, noise=False, late=late)
    begin = int(np.argmax(wanted > 0.0))
    t, ft = run.t[begin:] - run.t[begin], run.ft[begin:] / STEP
    outside = np.nonzero(np.abs(ft - 1.0) > BAND)[0]
    rise = float(t[np.argmax(ft >= 0.9)] - t[np.argmax(ft >= 0.1)])
    settling = float(t[min(outside[-1] + 1, len(t) - 1)]) if len(outside) else 0.0
    return Step(t, ft * STEP, rise, float(max(0.0, ft.max() - 1.0)), settling)
