"""What a controller must tolerate: loads (clamped, free, or in between), corners of the spread, lags.

    loads           locked, and the free ends with 0.5 to 100 times their inertia
    K_s             ± 10 %          b_m   ± 50 %
    path            one sample more than the one of the design, 2 ms of delay, both
    sensor          a mode of 33 Hz, damping ratio 0.02, 0.3 of the spring's torque in it

A case is a bench of the set as frequency responses: exact for hold, delays and mode (whose aliases are left
out, as all of those that lie above half the rate).

Each is the response of an effect where it is linear (Effect.response): at the command it is on the path to
the current, at the motor on all torque, at the F/T sensor on ft. The law does not know them; the margins do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import numpy.typing as npt

from rsea_ros.control.law import FT, Sampled, check_controllable, responses, sample_rig, z_of
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.signal_table import Port
from rsea_ros.errors import ParameterError
from rsea_ros.model.rig import END_NAMES, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import ComplexArray, FloatArray

LIGHTEST = "paper_moving_output"
LOCKED = "locked"
MULTIPLES = (0.5, 1.0, 2.0, 4.0, 10.0, 30.0, 100.0)
"""Of the free ends' inertia. At 100 times the paper's load hardly moves at the frequencies of control."""


def load_range(rig: Rig, free: Rig | None = None) -> Mapping[str, Rig]:
    """Return the rig by load: `locked`, and the free ends of `free` with 0.5 to 100 times their inertia.

    free: a bench whose ends are the lightest load; by default the rig itself. The actuator is the rig's in
    all. Raises ParameterError where `free` has no free end, or nothing can be controlled.
    """
    check_controllable(rig)
    loads = {LOCKED: lock(rig)}
    light = with_ends(rig, free or rig)
    ends = [end for end in END_NAMES if light.end_is_free(end)]
    if free is not None and not ends:
        raise ParameterError(
            f"rig {free.name}: both ends are clamped, expected a free one: it is the lightest load"
        )
    for multiple in MULTIPLES if ends else ():
        inertias = {f"{end}.inertia": multiple * light[f"{end}.inertia"] for end in ends}
        loads[f"free x {multiple:g}"] = light.with_values(inertias)
    return loads


def lightest(rig: Rig, name: str = "") -> Rig:
    """Return the rig whose ends are the lightest load: that of a name, else the rig, LIGHTEST if clamped."""
    if name:
        return load_rig(name)
    return load_rig(LIGHTEST) if rig.clamped == set(END_NAMES) else rig


def lock(rig: Rig) -> Rig:
    """Return the rig with both ends clamped."""
    return replace(rig, clamped=frozenset(END_NAMES))


def with_ends(rig: Rig, other: Rig) -> Rig:
    """Return the rig with the ends and loads of another one."""
    prefixes = (*(f"{end}." for end in END_NAMES), "housing.", "proximal_spring.")
    ends = {name: q for name, q in other.quantities.items() if name.startswith(prefixes)}
    rest = {name: q for name, q in rig.quantities.items() if not name.startswith(prefixes)}
    return replace(rig, quantities={**rest, **ends}, clamped=other.clamped)


def lag_responses(rig: Rig, plant: Sampled, hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Return the response of a sampled rig, shape (4, n), and of the path from command to current, (n,)."""
    response, path = responses(plant, hz), np.ones(len(hz), dtype=np.complex128)
    s = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    for setting in rig.effects:
        effect = effect_named(setting.name)
        if effect.response is None:
            continue
        factor = effect.response(effect.vector(setting.parameters), s)
        if effect.port == Port.COMMAND:
            path = path * factor
        else:
            response[FT if effect.port == Port.SENSOR else slice(None)] *= factor
    for row, name in enumerate(("ft", "velocity", "position")):  # those of `Sampled`
        if name in rig.sensors:
            response[row] *= rig.sensors[name].response(hz, plant.period)
    return response, path


@dataclass(frozen=True)
class Uncertainty:
    """stiffness, damping: relative, ±. samples: more than the design's. delay: s.

    mode: Hz, damping ratio, participation of a resonance of what carries the F/T sensor.
    """

    stiffness: float = 0.1
    damping: float = 0.5
    samples: int = 1
    delay: float = 2e-3
    mode: tuple[float, float, float] = (33.0, 0.02, 0.3)


@dataclass(frozen=True)
class BenchVariant:
    """One bench of the set: its load, K_s and b_m over the nominal ones, samples, delay (s), mode."""

    load: str
    stiffness: float = 1.0
    damping: float = 1.0
    samples: int = 0
    delay: float = 0.0
    participation: float = 0.0

    @property
    def nominal(self) -> bool:
        """Whether it is the rig itself with one of the loads."""
        return self == BenchVariant(self.load)

    def __str__(self) -> str:
        parts = [self.load, f"K_s x {self.stiffness:g}", f"b_m x {self.damping:g}"]
        parts += ["one sample late"] * (self.samples > 0) + ["delayed"] * (self.delay > 0.0)
        return ", ".join(parts + ["mode"] * (self.participation != 0.0))


@dataclass(frozen=True)
class Family:
    """Cases with their responses at hz (n,): plant (4, m, n) as `responses` has it, the path from a command
    to the torque and that to the current as it is measured, at the end of a sample: both (m, n)."""

    cases: tuple[BenchVariant, ...]
    hz: FloatArray
    plant: ComplexArray
    path: ComplexArray
    current: ComplexArray

    @cached_property
    def nominal(self) -> npt.NDArray[np.bool_]:
        """Which cases are the rig itself, shape (m,)."""
        return np.array([case.nominal for case in self.cases])


def corners(loads: Sequence[str], u: Uncertainty) -> list[BenchVariant]:
    """Return the rig with each load, and the corners of the set: for the synthesis."""
    sides = list(product((1 - u.stiffness, 1 + u.stiffness), (1 - u.damping, 1 + u.damping)))
    wire = ((0, 0.0), (u.samples, u.delay))
    return [BenchVariant(load) for load in loads] + [
        BenchVariant(load, k, b, samples, delay, part)
        for load, (k, b), (samples, delay), part in product(loads, sides, wire, (0.0, u.mode[2]))
    ]


def dense(loads: Sequence[str], u: Uncertainty, steps: int = 5) -> list[BenchVariant]:
    """Return the set on a grid, for the figures that a design states."""
    stiff, damp = (1.0 + part * np.linspace(-1.0, 1.0, steps) for part in (u.stiffness, u.damping))
    wire = product((0, u.samples), (0.0, 0.5 * u.delay, u.delay))
    grid = product(loads, stiff, damp, wire, (0.0, 0.5 * u.mode[2], u.mode[2]))
    return [BenchVariant(load, float(k), float(b), *path, part) for load, k, b, path, part in grid]


def variant_rig(load: Rig, case: BenchVariant) -> Rig:
    """Return a rig with the stiffness and damping of a case."""
    k, b = "spring.stiffness", "rotor.reflected_damping"
    return load.with_values({k: load[k] * case.stiffness, b: load[b] * case.damping})


def family(
    loads: Mapping[str, Rig], cases: Sequence[BenchVariant], u: Uncertainty, rate: float, hz: FloatArray
) -> Family:
    """Return the responses of cases at frequencies, Hz, below half the rate."""
    computed: dict[tuple[str, float, float], tuple[ComplexArray, ComplexArray]] = {}
    plants, paths, currents = [], [], []
    for case in cases:
        key = case.load, case.stiffness, case.damping
        if key not in computed:
            rig = variant_rig(loads[case.load], case)
            computed[key] = lag_responses(rig, sample_rig(rig, rate), hz)
        response, path = computed[key]
        plant = response.copy()
        plant[FT] *= mode_of(u.mode, case.participation, hz)
        late, current = lags_of(case, rate, hz)
        plants.append(plant)
        paths.append(path * late)
        currents.append(path * current)
    return Family(tuple(cases), hz, np.stack(plants, axis=1), np.array(paths), np.array(currents))


def lags_of(case: BenchVariant, rate: float, hz: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Return the factors of a case on the path from command to torque, and on the measured current."""
    back = 1.0 / z_of(1.0 / rate, hz)
    path: ComplexArray = back**case.samples * np.exp(-2j * np.pi * hz * case.delay)
    current: ComplexArray = back ** (case.samples + int(case.delay * rate + 1e-9))
    return path, current


def mode_of(mode: tuple[float, float, float], participation: float, hz: FloatArray) -> ComplexArray:
    """Return the response of a mode of the F/T sensor's mount to the torque. mode: as Uncertainty has it."""
    s, w = 2j * np.pi * hz, 2.0 * np.pi * mode[0]
    factor: ComplexArray = 1.0 - participation * s * s / (s * s + 2.0 * mode[1] * w * s + w * w)
    return factor
