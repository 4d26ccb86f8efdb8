"""Gains by synthesis: the softest output, and the least friction left, that the whole set of benches allows.

    minimise    mean of log |Z / Z_s| at 0.1, 0.3, 1 and 3 Hz, and log F
    F           the worst over the set of  sqrt(sum over n = 1, 3, 5 … of (4 / (n pi))^2 |P S(n f)|^2 / 2)
    subject to  |S| <= 2 for the rig with every load, <= 3 for every bench of the set
                |Z / Z_s| <= 2 at every frequency, and Re Z >= 0: stable with every passive arm
                arg(w / T_f) <= 170 deg, locked: friction makes no limit cycle
                noise of the sensors <= 1.5 % of the motor's torque at the motor, RMS

F is the RMS torque error for each N m of Coulomb friction that nobody has foreseen while the actuator goes
to and fro at f. P = T_d / T_m; S is the sensitivity, to a torque on the gear and to one on the command,
whichever is larger; Z the output impedance, Z_s that of the bare spring; w / T_f the gear's speed for a
torque on it, under control. Coulomb friction is a relay from w to T_f: it makes a limit cycle where that
response is real and negative (describing function; Armstrong-Helouvry, Amin, IEEE Trans. Automatic Control
41, 1996), which an integral and a disturbance observer that both act below a few Hz bring about. The loop is
the sampled one, with hold and one sample of delay, exact at every frequency. |S| <= M keeps a gain margin of
M / (M - 1) and a phase margin of 2 asin(1 / 2 M): 6 dB, 29 deg for 2; 3.5 dB, 19 deg for 3, and that with the
lag of the set. The set: uncertainty.py, its corners here, all of it in `rsea control`. The search is Nelder
and Mead's in the logarithms of the gains; then the poles of the closed loop, taken from the code that runs,
decide whether the design is let through.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.optimize import minimize

from rsea_ros.control import margins as loop, uncertainty
from rsea_ros.control.law import FT, VELOCITY, Gains, law_of, sample_rig
from rsea_ros.control.uncertainty import LOCKED, UNMEASURED, Family, Uncertainty, assumed, corners, family
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import Rig, motor_torque
from rsea_ros.records.record import ComplexArray, FloatArray

LOWEST = 0.04
"""Hz, where the grid of frequencies begins."""

SHARES = (1.0, 0.5, 0.2, 0.05, 0.0)
"""Of the torque: the loop must be stable with each of them, so that limits cannot make it oscillate."""

MARGINAL = 1.0 + 1e-6
EVALUATIONS, POLISHES = 200, 2
"""Of the search, and how often it begins where it ended: a simplex that has met a limit lies flat."""
HUNTING, HUNTED = np.radians(170.0), 0.1
"""The largest phase of the gear's speed for a torque on it, from HUNTED Hz on."""

MOVEMENT = 5.0
"""Hz, at which the actuator goes to and fro."""
SOFT = (0.1, 0.3, 1.0, 3.0)
"""Hz, at which the output should be soft."""
_STARTS = ((1.0, 1.2, 10.0, 1e-3, 0.1), (8.0, 2.0, 40.0, 1e-3, 0.2), (8.0, 2.0, 60.0, 5.0, 0.05))
"""k_p and k_i; k_d, k_w and q_frequency as parts of 1 / w_0, of J_m w_0 and of w_0, the natural frequency:
at slow rates, and at fast ones without and with a disturbance observer."""
_STRIDE = 0.5
_SHORT = 0.02
_AIM = 0.9995
"""Of the impedance allowed: the search may end that much beside its aim."""
HEAVY = ("x 30", "x 100")
"""Loads that are nearly locked: they are left to the check of what was found."""


@dataclass(frozen=True)
class DesignLimits:
    """Largest sensitivity of the rig itself, and of the whole set; largest impedance, over the spring's.

    noise: of the motor's largest torque, RMS.
    """

    sensitivity: float = 2.0
    robust: float = 3.0
    impedance: float = 2.0
    noise: float = 0.015


@dataclass(frozen=True)
class ControllerDesign:
    """Gains at a rate (Hz), margins of the rig by load; friction_left: N m RMS per N m, worst of the set.

    sensitivity: largest of the set's corners. impedance: largest, over the spring's. noise: N m RMS at the
    motor. uncertainty: the set.
    """

    gains: Gains
    rate: float
    margins: Mapping[str, loop.Margins]
    friction_left: float
    sensitivity: float = float("nan")
    impedance: float = float("nan")
    noise: float = float("nan")
    uncertainty: Uncertainty = UNMEASURED


@dataclass(frozen=True)
class SynthesisProblem:
    """What a design is looked for on: the corners of the set, and the locked rig moved from outside.

    The latter on the grid of `check`: between 60 frequencies the impedance was 0.5 % above its limit.
    """

    rig: Rig
    rate: float
    family: Family
    moved: loop.Moved
    uncertainty: Uncertainty


@dataclass(frozen=True)
class RobustnessScore:
    """Sensitivity, friction left and encirclements of each case, shape (m,); |Z / Z_s|, shape (n,).

    turned: the largest phase of Z beyond 90 deg, and of w / T_f beyond HUNTING, rad. noise: N m.
    """

    sensitivity: FloatArray
    friction: FloatArray
    wound: FloatArray
    softness: FloatArray
    turned: float
    noise: float


def design(
    rig: Rig,
    loads: Mapping[str, Rig],
    rate: float,
    demand: DesignLimits | None = None,
    u: Uncertainty | None = None,
) -> ControllerDesign:
    """Return the gains of a rig. Raises ParameterError where none keep the set stable with its margins.

    u: by default that of `assumed`.
    """
    demand, u = demand or DesignLimits(), u or assumed(rig, rate)
    few = {name: load for name, load in loads.items() if not name.endswith(HEAVY)}
    problem = _problem(rig, few, rate, grid(rate, 100, u.mode), u)

    def cost(x: FloatArray) -> float:
        score = _score(problem, _gains(x, rate))
        soft = np.log(np.interp(SOFT, problem.moved.hz, score.softness))
        wanted = np.mean([*soft, np.log(score.friction.max())])
        return float(wanted) + 20.0 * (_shortfall(problem, score, demand) + _beside(problem, score, demand))

    gains = _gains(_search(cost, np.log(_starts(rig))), rate)
    if _shortfall(problem, _score(problem, gains), demand) > _SHORT:
        nearest = _design(problem, gains)
        raise ParameterError(
            f"rig {rig.name}: no gains keep the whole set of benches stable with its margins at {rate:g} Hz: "
            f"largest sensitivity {nearest.sensitivity:.2f}, expected {demand.robust:g} ({u})"
        )
    return check(rig, loads, rate, gains, u)


def check(
    rig: Rig, loads: Mapping[str, Rig], rate: float, gains: Gains, u: Uncertainty | None = None
) -> ControllerDesign:
    """Return margins of given gains. Raises ParameterError where a bench of the set is unstable."""
    law, u = law_of(rig, rate, gains), u or assumed(rig, rate)
    for name, load in loads.items():
        for share in SHARES:
            pole = loop.largest_pole(law, sample_rig(load, rate), share)
            if pole > MARGINAL:
                raise ParameterError(
                    f"rig {rig.name}: unstable at {rate:g} Hz with load {name!r}, {share:.0%} of the torque: "
                    f"closed-loop pole of modulus {pole:.4f}, expected below 1; {gains}"
                )
    problem = _problem(rig, loads, rate, grid(rate, mode=u.mode), u)
    score = _score(problem, gains)
    if (score.wound > 0.5).any():
        case = problem.family.cases[int(np.argmax(score.wound))]
        raise ParameterError(
            f"rig {rig.name}: unstable at {rate:g} Hz with load {case} and the lags of its effects, "
            f"expected a loop that does not encircle -1; {gains}"
        )
    return _design(problem, gains)


def worst(designed: ControllerDesign) -> str:
    """Return the least margins in words."""
    name, least = min(designed.margins.items(), key=lambda item: item[1].phase)
    return (
        f"phase margin {least.phase:.1f} deg, gain margin {least.gain:.1f} dB, "
        f"delay margin {least.delay:.2f} samples with load {name!r}"
    )


def grid(rate: float, points: int = 150, mode: uncertainty.Mode | None = None) -> FloatArray:
    """Return frequencies up to half the rate, Hz, those of the movement and of a mode among them."""
    highest = 0.4995 * rate
    parts = [
        np.geomspace(LOWEST, 0.15 * rate, 5 * points // 2), np.linspace(0.15 * rate, highest, points // 2),
        MOVEMENT * _odd(highest),
    ]  # fmt: skip
    if mode:
        parts.append(mode[0] * np.linspace(0.6, 1.4, points))
    hz = np.unique(np.concatenate(parts))
    return hz[hz <= highest]


def _starts(rig: Rig) -> FloatArray:
    """Return the gains at which searches begin, shape (starts, 5)."""
    inertia = rig["rotor.reflected_inertia"]
    natural = float(np.sqrt(rig["spring.stiffness"] / inertia))
    return np.array(_STARTS) * [1.0, 1.0 / natural, 1.0, natural, inertia * natural]


def _problem(
    rig: Rig, loads: Mapping[str, Rig], rate: float, hz: FloatArray, u: Uncertainty
) -> SynthesisProblem:
    benches = family(loads, corners(tuple(loads), u), rate, hz)
    return SynthesisProblem(rig, rate, benches, loop.distal_responses(rig, rate, grid(rate)), u)


def _score(problem: SynthesisProblem, gains: Gains) -> RobustnessScore:
    law, f, moved = law_of(problem.rig, problem.rate, gains), problem.family, problem.moved
    acted = loop.actions(law, f.hz)
    memory, whole = loop.returns(law, f.plant, f.hz, f.path, f.current, acted)
    sensitivity = (np.maximum(np.abs(memory), 1.0) / np.abs(whole)).max(axis=1)
    locked = np.array([case.load == LOCKED and case.samples == 0 for case in f.cases])
    slow = (f.hz >= HUNTED) & (f.hz < 0.25 * problem.rate)
    speed = np.angle((f.plant[VELOCITY] * memory / whole)[locked][:, slow])
    opposed = -moved.impedance(law)
    turned = max(0.0, float(np.abs(np.angle(opposed)).max()) - 0.5 * np.pi)
    return RobustnessScore(
        sensitivity,
        friction_left(f.plant[FT] * memory / whole, f.hz),
        loop.encirclements(whole),
        np.abs(opposed / moved.spring),
        max(turned, float(speed.max()) - HUNTING),
        _noise(problem, acted, whole[0]),
    )


def _noise(problem: SynthesisProblem, acted: Sequence[ComplexArray], whole: ComplexArray) -> float:
    """Return the RMS of what the sensors' noise makes of the command, N m: white up to half the rate."""
    on_ft, on_velocity, _ = acted
    levels = [sensor.level if (sensor := problem.rig.sensors.get(c)) else 0.0 for c in ("ft", "velocity")]
    power = (np.abs(on_ft) * levels[0]) ** 2 + (np.abs(on_velocity) * levels[1]) ** 2
    return float(np.sqrt(2.0 * np.trapezoid(power / np.abs(whole) ** 2, problem.family.hz) / problem.rate))


def friction_left(response: FloatArray, hz: FloatArray) -> FloatArray:
    """Return the RMS torque error per N m of friction, shape (m,). response: to a torque on the gear."""
    n = _odd(hz[-1])
    at = np.searchsorted(hz, n * MOVEMENT)
    left = 4.0 / (np.pi * n) / np.sqrt(2.0) * np.abs(response[:, at])
    total: FloatArray = np.sqrt(np.sum(np.square(left), axis=1))
    return total


def _design(problem: SynthesisProblem, gains: Gains) -> ControllerDesign:
    law, f, score = law_of(problem.rig, problem.rate, gains), problem.family, _score(problem, gains)
    memory, whole = loop.returns(law, f.plant, f.hz, f.path, f.current)
    by_load = {
        case.load: loop.margins(whole[k] / memory[k] - 1.0, f.hz, 1.0 / problem.rate)
        for k, case in enumerate(f.cases)
        if case.nominal
    }
    return ControllerDesign(
        gains,
        problem.rate,
        MappingProxyType(by_load),
        float(score.friction.max()),
        float(score.sensitivity.max()),
        float(score.softness.max()),
        score.noise,
        problem.uncertainty,
    )


def _shortfall(problem: SynthesisProblem, score: RobustnessScore, demand: DesignLimits) -> float:
    """Return by how much sensitivities are beyond the demand, as parts of it, added up; 0 when met."""
    allowed = np.where(problem.family.nominal, demand.sensitivity, demand.robust)
    over = np.maximum(0.0, score.sensitivity / allowed - 1.0)
    return float(over.sum() + 10.0 * np.count_nonzero(score.wound > 0.5))


def _beside(problem: SynthesisProblem, score: RobustnessScore, demand: DesignLimits) -> float:
    """Return by how much impedance, phases and noise are beyond the demand; 0 when met."""
    allowed = _AIM * demand.impedance, demand.noise * motor_torque(problem.rig)[0]
    over = (max(0.0, v / m - 1.0) for v, m in zip((score.softness.max(), score.noise), allowed, strict=True))
    return float(sum(over)) + max(0.0, score.turned)


def _odd(highest: float) -> FloatArray:
    """Return 1, 3, 5 … of the harmonics of the movement below a frequency, Hz."""
    return np.arange(1.0, highest / MOVEMENT, 2.0)


def _search(cost: Callable[[FloatArray], float], starts: FloatArray) -> FloatArray:
    def searched(x: FloatArray) -> FloatArray:
        simplex = x + np.vstack([np.zeros(len(x)), _STRIDE * np.eye(len(x))])
        options = {"maxfev": EVALUATIONS, "xatol": 1e-3, "fatol": 1e-4, "adaptive": True}
        found: FloatArray = minimize(
            cost, x, method="Nelder-Mead", options={**options, "initial_simplex": simplex}
        ).x
        return found

    x = min((searched(start) for start in starts), key=cost)
    for _ in range(POLISHES):
        x = searched(x)
    return x


def _gains(x: FloatArray, rate: float) -> Gains:
    k_p, k_d, k_i, q, k_w = (float(v) for v in np.exp(np.clip(x, -12.0, 12.0)))
    return Gains(k_p, k_d, k_i, min(q, 0.45 * rate), k_w)
