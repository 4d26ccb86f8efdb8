"""What a controller must tolerate: loads (clamped, free, or in between), corners of the spread, lags.

    loads           locked, and the free ends with 0.5 to 100 times their inertia
    K_s, b_m, J_m   the 95 % intervals of a fit, no less than 2, 10 and 0 %; else 10, 50 and 0 %. A stiff
                    spring stands with a light rotor: there the natural frequency is furthest off
    path            one sample more than that of the design, or 1/80 of the natural period if that is longer
    sensor          a mode of the F/T sensor's mount, where one is stated

`load_uncertainty` reads the set of a bench from a file (docs/control.md), with the timing that was measured
there. A case is a bench of the set as frequency responses: exact for hold, delays and mode (whose aliases are
left out, as all of those that lie above half the rate).

Each is the response of an effect where it is linear (Effect.response): at the command it is on the path to
the current, at the motor on all torque, at the F/T sensor on ft. The law does not know them; the margins do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rsea_ros.control.law import FT, Sampled, check_controllable, responses, sample_rig, z_of
from rsea_ros.documents import strict_yaml
from rsea_ros.documents.units import with_unit
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.effects.signal_table import Port
from rsea_ros.errors import FieldError, ParameterError
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


Mode = tuple[float, float, float]
"""Hz, damping ratio, participation of a resonance of what carries the F/T sensor."""
LAG = 80.0
"""Of the natural period: a bench whose timing nobody has measured may be late by one part of so many, 2 ms of
the paper's 0.16 s; 4.5 deg of phase at its natural frequency."""


@dataclass(frozen=True)
class Uncertainty:
    """stiffness, damping, inertia: relative, ±. samples: more than the design's. delay: s."""

    stiffness: float = 0.1
    damping: float = 0.5
    inertia: float = 0.0
    samples: int = 1
    delay: float = 0.0
    mode: Mode | None = None

    def __str__(self) -> str:
        wide = {"K_s": self.stiffness, "b_m": self.damping, "J_m": self.inertia}
        parts = [f"{name} ± {100.0 * part:.3g} %" for name, part in wide.items() if part]
        parts += [f"{self.samples} sample{'s' * (self.samples > 1)} late"] * (self.samples > 0)
        parts += [f"{1e3 * self.delay:.3g} ms of delay"] * (self.delay > 0.0)
        if self.mode:
            parts.append(f"a mode of {self.mode[0]:g} Hz at the sensor")
        return ", ".join(parts) or "nothing"


UNMEASURED = Uncertainty()
"""The set of an actuator of which nothing is stated."""


def assumed(rig: Rig, rate: float) -> Uncertainty:
    """Return the set of a rig whose timing nobody has measured. rate: Hz."""
    period = 2.0 * np.pi * np.sqrt(rig["rotor.reflected_inertia"] / rig["spring.stiffness"])
    stiffness, damping, inertia = (_width(rig, name, usual) for name, usual in USUAL.items())
    return Uncertainty(stiffness, damping, inertia, delay=max(0.0, float(period) / LAG - 1.0 / rate))


USUAL = {"spring.stiffness": 0.1, "rotor.reflected_damping": 0.5, "rotor.reflected_inertia": 0.0}
"""Parts by which a value that no fit has given an interval may be off; an error of J_m is one of K_s."""
DRIFT = 0.2
"""Of these: the least for a fitted value, which load and temperature change."""


def _width(rig: Rig, name: str, usual: float) -> float:
    """Return half of the 95 % interval of a value, relative."""
    quantity = rig.quantities[name]
    if quantity.ci95 is None or not quantity.value:
        return usual
    low, high = (abs(edge / quantity.value - 1.0) for edge in quantity.ci95)
    return min(max(low, high, DRIFT * usual), MOST["stiffness"])


KEYS = {"stiffness": "1", "damping": "1", "inertia": "1", "late_samples": "1", "delay": "s"}
MODE = {"frequency": "Hz", "damping_ratio": "1", "participation": "1"}
MOST = {**dict.fromkeys(KEYS, 0.9), "late_samples": 5.0, "delay": 0.05, "frequency": 1e4, **dict.fromkeys(
    ("damping_ratio", "participation"), 1.0)}  # fmt: skip


def load_uncertainty(path: str | Path, rig: Rig, rate: float) -> Uncertainty:
    """Return the set of a YAML file (docs/control.md); what it leaves out is that of `assumed`.

    Raises ParameterError with file, line, field, value and expected value.
    """

    def build(content: Any) -> Uncertainty:
        body = strict_yaml.mapping(content, "file", f"a mapping with keys of {', '.join(KEYS)}, mode")
        strict_yaml.only_keys(body, {*KEYS, "mode"}, "file")
        stated = {name: _stated(body[name], name, KEYS[name]) for name in KEYS if name in body}
        late = stated.pop("late_samples", float(UNMEASURED.samples))
        if late % 1.0:
            raise FieldError(f"late_samples = {late:g}, expected a whole number of samples", "late_samples")
        whole: dict[str, Any] = {**stated, "samples": int(late)}
        if "mode" in body:
            parts = strict_yaml.mapping(body["mode"], "mode", f"a mapping with the keys {', '.join(MODE)}")
            strict_yaml.only_keys(parts, set(MODE), "mode")
            whole["mode"] = tuple(_stated(parts.get(name), f"mode.{name}", MODE[name]) for name in MODE)
        return replace(assumed(rig, rate), **whole)

    expected = "an uncertainty in YAML that can be read"
    return strict_yaml.load(Path(path), expected, lambda message, _: ParameterError(message), build)


def _stated(body: Any, name: str, unit: str) -> float:
    """Return a value `{value: 2, unit: ms}` in SI; a bare number where the unit is 1."""
    if unit == "1" and not isinstance(body, Mapping):
        body = {"value": body, "unit": "1"}
    pair = strict_yaml.mapping(body, name, f"{{value: …, unit: {unit}}}")
    strict_yaml.only_keys(pair, {"value", "unit"}, name)
    factor = 1e-3 if unit == "s" and pair.get("unit") == "ms" else 1.0
    if factor == 1.0:
        strict_yaml.unit(pair.get("unit"), f"{name}.unit", unit)
    value = factor * strict_yaml.number(pair.get("value"), name, unit)
    most = MOST[name.rpartition(".")[2]]
    if not 0.0 <= value <= most:
        raise FieldError(f"{name} = {with_unit(f'{value:g}', unit)}, expected 0 to {most:g}", name)
    return value


@dataclass(frozen=True)
class BenchVariant:
    """One bench of the set: its load, K_s and b_m over the nominal ones, samples, delay (s), mode; J_m."""

    load: str
    stiffness: float = 1.0
    damping: float = 1.0
    samples: int = 0
    delay: float = 0.0
    mode: Mode | None = None
    inertia: float = 1.0

    @property
    def nominal(self) -> bool:
        """Whether it is the rig itself with one of the loads."""
        return self == BenchVariant(self.load)

    def __str__(self) -> str:
        parts = [self.load, f"K_s x {self.stiffness:g}", f"b_m x {self.damping:g}"]
        parts += [f"J_m x {self.inertia:g}"] * (self.inertia != 1.0)
        parts += ["one sample late"] * (self.samples > 0) + ["delayed"] * (self.delay > 0.0)
        return ", ".join(parts + ["mode"] * (self.mode is not None))


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
    stiff = ((1.0 - u.stiffness, 1.0 + u.inertia), (1.0 + u.stiffness, 1.0 - u.inertia))
    sides = product(stiff, (1.0 - u.damping, 1.0 + u.damping))
    wires = dict.fromkeys(((0, 0.0), (u.samples, u.delay)))
    every = product(loads, sides, wires, dict.fromkeys((None, u.mode)))
    return [BenchVariant(load) for load in loads] + [
        BenchVariant(load, k, b, samples, delay, mode, j)
        for load, ((k, j), b), (samples, delay), mode in every
    ]


def dense(loads: Sequence[str], u: Uncertainty, steps: int = 5) -> list[BenchVariant]:
    """Return the set on a grid, for the figures that a design states."""
    side = np.linspace(-1.0, 1.0, steps)
    stiff = [(1.0 + part * u.stiffness, 1.0 - part * u.inertia) for part in side.tolist()]
    wires = product({0: 0, u.samples: 0}, dict.fromkeys((0.0, 0.5 * u.delay, u.delay)))
    modes: list[Mode | None] = [None]
    if u.mode:
        modes += [(u.mode[0], u.mode[1], part * u.mode[2]) for part in (0.5, 1.0)]
    every = product(loads, stiff, (1.0 + u.damping * side).tolist(), wires, modes)
    return [BenchVariant(load, k, b, n, delay, mode, j) for load, (k, j), b, (n, delay), mode in every]


def variant_rig(load: Rig, case: BenchVariant) -> Rig:
    """Return a rig with the stiffness, damping and inertia of a case."""
    factors = {
        "spring.stiffness": case.stiffness, "rotor.reflected_damping": case.damping,
        "rotor.reflected_inertia": case.inertia,
    }  # fmt: skip
    return load.with_values({name: load[name] * factor for name, factor in factors.items()})


def family(
    loads: Mapping[str, Rig], cases: Sequence[BenchVariant], rate: float, hz: FloatArray
) -> Family:
    """Return the responses of cases at frequencies, Hz, below half the rate."""
    computed: dict[tuple[str, float, float, float], tuple[ComplexArray, ComplexArray]] = {}
    plants, paths, currents = [], [], []
    for case in cases:
        key = case.load, case.stiffness, case.damping, case.inertia
        if key not in computed:
            rig = variant_rig(loads[case.load], case)
            computed[key] = lag_responses(rig, sample_rig(rig, rate), hz)
        response, path = computed[key]
        plant = response.copy()
        plant[FT] *= mode_of(case.mode, hz)
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


def mode_of(mode: Mode | None, hz: FloatArray) -> ComplexArray:
    """Return the response of a mode of the F/T sensor's mount to the torque."""
    s, (at, ratio, participation) = 2j * np.pi * hz, mode or (1.0, 1.0, 0.0)
    w = 2.0 * np.pi * at
    factor: ComplexArray = 1.0 - participation * s * s / (s * s + 2.0 * ratio * w * s + w * w)
    return factor
