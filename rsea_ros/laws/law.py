"""A law: its terms with coefficients, how it reads, where its variables lie; and the result of a search."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rsea_ros.documents.wording import list_names
from rsea_ros.effects.effect import Claims, Effect
from rsea_ros.identification.missing_torque import Place
from rsea_ros.laws.sparse_regression import Dependence
from rsea_ros.laws.terms import CREEP, Term
from rsea_ros.laws.variables import Variables
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.records.record import FloatArray


@dataclass(frozen=True)
class FittedTerm:
    """One term of a law with its coefficient and shape, SI, and their 95 % intervals where they are known."""

    term: Term
    coefficient: float
    shape: float = 0.0
    ci95: tuple[float, float] | None = None
    shape_ci95: tuple[float, float] | None = None


@dataclass(frozen=True)
class LearntCurve:
    """A learnt curve: values (N m, rad at the encoder) over a variable, times a factor, held at its ends."""

    over: str
    factor: str
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True)
class Law:
    """A law at one place. parts: of a short law. curve: of a learnt one, which has no parts.

    ranges: of each variable that it reads, its largest size in the data.
    """

    name: str
    place: Place
    regressor: str
    parts: tuple[FittedTerm, ...]
    ranges: Mapping[str, float]
    curve: LearntCurve | None = None

    @property
    def is_learnt(self) -> bool:
        """Whether it is a curve, which has no name in the field."""
        return self.curve is not None

    @property
    def is_friction(self) -> bool:
        """Whether a term of it turns with the sign of the speed."""
        return any(part.term.friction for part in self.parts)

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters of its effect file by name."""
        if self.curve is not None:
            return {"size": 1.0}
        values: dict[str, float] = {}
        for part, names in zip(self.parts, self.names, strict=True):
            values[names[0]] = part.coefficient
            if names[1]:
                values[names[1]] = part.shape
        return values | ({"creep_velocity": CREEP} if self.is_friction else {})

    @property
    def names(self) -> list[tuple[str, str]]:
        """Names of the coefficient and shape of each term; a second one of a name gets a number."""
        counts: dict[str, int] = {}

        def unique(name: str) -> str:
            counts[name] = counts.get(name, 0) + 1
            return name if counts[name] == 1 else f"{name}_{counts[name]}"

        shared: dict[float, str] = {}
        names = []
        for part in self.parts:
            name = unique(part.term.name)
            if part.term.shape == "cycles_per_revolution":
                shape = shared.setdefault(part.shape, "") or unique(part.term.shape)
                shared[part.shape] = shape
            else:
                shape = unique(part.term.shape) if part.term.shape else ""
            names.append((name, shape))
        return names

    def with_parameters(self, values: Mapping[str, float], ci95: Mapping[str, tuple[float, float]]) -> Law:
        """Return the law with fitted parameters and their intervals, by name."""
        parts = tuple(
            replace(
                part, coefficient=values[c], shape=values[s] if s else 0.0, ci95=ci95.get(c),
                shape_ci95=ci95.get(s),
            )
            for part, (c, s) in zip(self.parts, self.names, strict=True)
            if values[c] != 0.0
        )
        regressors = dict.fromkeys(part.term.regressor for part in parts)
        return replace(self, parts=parts, regressor=list_names(list(regressors)))

    def values(self, variables: Variables) -> FloatArray:
        """Return the law along a record."""
        if self.curve is None:
            return np.asarray(sum(p.coefficient * variables.values(p.term, p.shape) for p in self.parts))
        from rsea_ros.laws.candidates import factor_of

        curve = np.interp(variables.letters[self.curve.over], self.curve.x, self.curve.y)
        return curve * factor_of(variables, self.place, self.curve.over, self.curve.factor)


_SYMBOLS = {"w": "ω", "q": "q", "theta": "θ", "d": "d", "T": "T_s", "u": "u", "t": "t", "h": "φ"}


def equation_of(law: Law) -> str:
    """Return the equation with the names of the parameters, in plain text."""
    left = {
        "encoder": "position error",
        "ft": "T_ft error",
        "motor": "T_m added",
        "command": "T_m added",
    }.get(law.place, "T")
    if law.curve is not None:
        factor = {"": "", "T": "·|T_s|", "u": "·u", "w": "·ω", "d": "·d"}[law.curve.factor]
        return f"{left} = size · f({_SYMBOLS[law.curve.over]}){factor}, f learnt from data"
    terms = []
    for part, (c, s) in zip(law.parts, law.names, strict=True):
        text = part.term.equation.format(a=s) if s else part.term.equation
        if s and s not in text:
            text += f" with {s}"
        bare = text.removeprefix("-")
        sign = "-" if part.term.friction or bare != text else ""
        terms.append(f"{sign}{c}" if bare == "1" else f"{sign}{c} · {bare}")
    tail = ", smooth below creep_velocity" if law.is_friction else ""
    return f"{left} = {' + '.join(terms).replace('+ -', '- ')}{tail}"


def about_of(law: Law) -> str:
    """Return the meaning of the law in a few words."""
    kind = "learnt law" if law.is_learnt else "law found in data"
    return f"{kind}: {'angle error' if law.place == 'encoder' else 'torque'} by {law.regressor}"


READS = {"w": "GEAR_VELOCITY", "q": "OUTPUT_ANGLE", "theta": "ROTOR_ANGLE", "d": "DEFLECTION", "T": "LOAD",
          "u": "COMMAND", "h": "HOUSING_ANGLE"}  # fmt: skip


def words_of(expression: str) -> set[str]:
    return set(re.findall(r"[a-z_A-Z]+", expression))


def letters_of(law: Law) -> set[str]:
    """Return the letters of the variables that a law reads."""
    remembered = {part.term.remembers for part in law.parts if part.term.memory}
    return (names_in(law) | remembered | ({"w"} if law.is_friction else set())) & set(READS)


def names_in(law: Law) -> set[str]:
    names = {law.curve.over, law.curve.factor} if law.curve is not None else set()
    return names.union(*(words_of(part.term.expression) for part in law.parts))


@dataclass(frozen=True)
class Tried:
    """A compared model: its terms, and its held-out residual over that of the base."""

    place: str
    terms: tuple[str, ...]
    left: float
    chosen: bool = False


@dataclass(frozen=True)
class FigurePoints:
    """The missing torque beside a law, point by point, for the page.

    t: s. values, law: N m, rad at the encoder. over: the letter of the variable that the law
    depends on most. sd: of a value.
    """

    t: FloatArray
    x: FloatArray
    values: FloatArray
    law: FloatArray
    over: str
    sd: float


@dataclass(frozen=True)
class WrittenLaw:
    """A law, its effect, the text of its file, and the points for its figure."""

    law: Law
    effect: Effect
    source: str
    claims: Claims
    shown: FigurePoints


@dataclass(frozen=True)
class LawResult:
    """laws: most important first; empty where no law explains the residual.

    gain: 1 - RMS(with the laws) / RMS(without) on test blocks that were not used before, with its 95 %
    interval, each channel in units of the base's residual. share: of the power above the noise.
    left, noise: RMS of each channel before and after, and of its noise, on those blocks.
    rig_choice: how the user chose the rig and the data.
    """

    rig_name: str
    sources: tuple[str, ...]
    duration: float
    base_rig: Rig
    rig: Rig
    dependences: tuple[Dependence, ...]
    tried: tuple[Tried, ...]
    laws: tuple[WrittenLaw, ...]
    gain: float
    gain_ci95: tuple[float, float]
    share: float
    before: Mapping[str, float]
    after: Mapping[str, float]
    noise: Mapping[str, float]
    at_floor: bool
    rig_choice: RigChoice = field(default_factory=RigChoice)
