"""The result of a search for a law: the dependences, the laws with their files, and their gain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rsea_ros.effects.effect import Claims, Effect
from rsea_ros.laws.law import Law
from rsea_ros.laws.sparse_regression import Dependence
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.records.record import FloatArray


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
