"""Every number that steers a verdict: its meaning, its unit, and why it has this value.

The numbers of noise and data stand where they are used, each with its reason, and no setting moves them:
identification/noise.py, noise_level.py and coloured.py (noise of a channel), checks/ (faulty samples).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple, TypeVar

from rsea_ros.errors import ParameterError

T = TypeVar("T")
MOST_CAUSES = 4
_CHOSEN = "chosen on the benchmark; bench/settings_curve.py shows the outcomes over it"
_CALIBRATED = "fixed when coefficients.py was fitted: after a change, `bench/calibration.py fit`"


class Setting(NamedTuple):
    """One setting as a report shows it. name: `group.field`."""

    name: str
    value: Any
    unit: str
    meaning: str
    reason: str


def number(value: T, unit: str, meaning: str, reason: str = _CHOSEN) -> T:
    """Declare a setting of a group with its meaning, unit and reason."""
    described = {"unit": unit, "meaning": meaning, "reason": reason}
    return field(default=value, metadata=described)


@dataclass(frozen=True)
class BlockSettings:
    """The blocks of a record, and the coherence over them that shows a missed response (coherence.py)."""

    longest: float = number(
        1.0, "s", "length of a block", "longer than a bench remembers: blocks are independent of each other"
    )
    shortest: float = number(
        0.25, "s", "length of a block below which short records have fewer blocks",
        "every part of a short sweep is in training, validation and test",
    )  # fmt: skip
    enough: int = number(
        120, "1", "blocks; a record with fewer of the longest is cut into shorter ones",
        "a quarter of them, 30, test: enough for a bootstrap over blocks",
    )  # fmt: skip
    false_alarm: float = number(
        0.01, "1", "probability that noise alone passes for a missed response in any line of a record",
        "sets the least coherence^2 by the number of blocks (Carter 1987)",
    )  # fmt: skip
    response_clear: float = number(
        0.3, "1", "coherence^2 of residual and command above which a response is missed, however small",
        "with 16 blocks noise alone reaches 0.26 in one line of a hundred",
    )  # fmt: skip
    response_share: float = number(
        0.1, "1", "share of the simulated response up to which an error of it is the simulation's own"
    )
    response_blocks: int = number(
        16, "1", "blocks without faulty samples below which no response counts as missed",
        "of fewer, noise alone is as coherent as a response",
    )  # fmt: skip


@dataclass(frozen=True)
class FloorSettings:
    """RMS of a residual over the noise of its channel, and what each level means."""

    only_noise: float = number(
        1.04,
        "1",
        "below it in every channel the search ends",
        "4 standard deviations of a white residual at 80 s of 280 Hz (noise_level.py)",
    )
    reached: float = number(1.1, "1", "up to it on the test blocks a channel has reached its floor")
    misfit: float = number(1.5, "1", "above it a channel misfits: causes must take half of that away")
    large_misfit: float = number(3.0, "1", "above it a channel misfits much: causes may explain it alone")
    share_left: float = number(0.5, "1", "of a misfit: what may be left where causes are named")
    far: float = number(
        5.0, "1", "from it on, in the worst channel, a model is far from the floor",
        "what is left is no noise there: priors say nothing and more parameters always gain a little",
    )  # fmt: skip


@dataclass(frozen=True)
class AcceptanceSettings:
    """When a candidate is better than another on the validation blocks."""

    doubt: float = number(
        0.025, "1", "quantile of the bootstrap of the gain that must lie above zero", "95 %, two-sided"
    )
    resamples: int = number(
        1000, "1", "draws of that bootstrap", "25 of them lie beyond the quantile: it is known to a fifth"
    )
    price: float = number(
        2.0, "1", "loss that each parameter must bring", "what a useless one gains (Akaike 1974)"
    )
    matters: float = number(0.02, "1", "fall of some channel's residual below which a gain does not matter")
    response_left: float = number(
        0.5, "1", "share of a missed response (coherence^2) below which seeing it matters by itself"
    )
    fall: float = number(0.1, "1", "fall of some channel's residual that one more cause must bring")
    fall_in_doubt: float = number(
        0.3, "1", "fall of the worst channel for a pair, a replacement, or a third cause that leaves much",
        "such bend to whatever is left: they must bring three times as much",
    )  # fmt: skip
    causes_in_doubt: int = number(2, "1", "causes from which one more counts as doubtful while far")
    room: float = number(
        0.1, "1", "how much larger the residual of a simpler model may be while far, for each number it saves"
    )
    prior_gain: float = number(
        1.0, "1", "fall of the prior's cost that decides between equals", "odds of 1.6"
    )
    near_bound: float = number(
        1e-6, "1", "share of its span within which a value is at its bound", "rounding of the fit"
    )


@dataclass(frozen=True)
class FitSettings:
    """How far candidates are fitted."""

    first_iterations: int = number(25, "1", "Gauss-Newton steps of the nominal model's first fit")
    iterations: int = number(12, "1", "steps of a fit that begins near its end")
    present_iterations: int = number(5, "1", "steps of the present model's fit to the short pieces")
    piece_iterations: int = number(12, "1", "steps of an effect's fit to the short pieces")
    full_iterations: int = number(6, "1", "steps of an effect's first fit to all training blocks")
    gain: float = number(2e-4, "1", "relative fall of the cost, at the noise, below which a fit is done")
    farthest: float = number(
        20.0, "1", "times the noise up to which that fall grows with the residual",
        "of a residual far above the noise small falls mean nothing",
    )  # fmt: skip
    final_gain: float = number(
        1e-6, "1", "the same for the models that are tested", "far below the doubt of a parameter"
    )


@dataclass(frozen=True)
class PieceSettings:
    """The short pieces of the training blocks on which effects are screened."""

    run_up: float = number(
        0.5, "s", "simulated and not compared before a piece", "the measured state decays within it"
    )
    enough: float = number(14.0, "s", "data in all pieces, half of them spread evenly, half at the worst")


@dataclass(frozen=True)
class ForwardSettings:
    """Which effects a forward step fits, and how thoroughly."""

    piece_fits: int = number(9, "1", "effects that are fitted to the pieces after the screening")
    full_fits: int = number(3, "1", "effects of each closeness that are fitted to all training blocks")
    behind_first: float = number(4.0, "1", "of the best cost on pieces: how close the first of them must be")
    behind_next: float = number(1.1, "1", "of the best cost on pieces: how close the others must be")
    hope_one: float = number(0.98, "1", "of the present cost on pieces: no hope above it, while far")
    hope_two: float = number(0.9, "1", "the same for two effects")
    hope_on_angle: float = number(0.5, "1", "the same for an effect simulated on the measured rotor angle")
    moved: float = number(0.02, "1", "change of what a channel leaves, from which a fit is repeated")
    alike: float = number(0.02, "1", "of the loss: a rival so close is refused for its size, not its fit")
    paired: int = number(3, "1", "effects with which pairs begin, and partners that each is tried with")
    paired_fits: int = number(2, "1", "pairs that are fitted to all training blocks")
    screening_steps: int = number(2, "1", "Gauss-Newton steps of an effect's screening, with old derivatives")
    screening_part: float = number(
        0.3, "1", "share of such a step that is tried where the whole one does not lower the cost"
    )
    causes_beside_a_pair: int = number(
        1, "1", "causes beside which pairs are tried", "beside more, pairs bend to whatever is left"
    )
    replacements: int = number(2, "1", "steps that may replace a cause, beside those that add one")


@dataclass(frozen=True)
class EvidenceSettings:
    """What the probability of a cause is computed from (naming/), and which rivals it has."""

    parts: int = number(4, "1", "parts of amplitude and of time, for the shape of a law", _CALIBRATED)
    bands: int = number(6, "1", "frequency bands, for the shape of a law", _CALIBRATED)
    least_spread: float = number(
        3e-3, "1", "spread of lambda that two right simulations of one law have", _CALIBRATED
    )
    most_spread: float = number(3.0, "1", "spread of lambda from which more says no more", _CALIBRATED)
    surest: float = number(
        4.0, "1", "log odds among rivals from which more says no more: all of them may be wrong", _CALIBRATED
    )
    least_weight: float = number(
        0.02, "1", "weight among all that was tried in a cause's place, from which an effect is a rival",
        _CALIBRATED,
    )  # fmt: skip
    most_rivals: int = number(3, "1", "rivals of a cause that are weighed", _CALIBRATED)


@dataclass(frozen=True)
class NamingSettings:
    """From which probability a cause is named, and as what (naming/status.py)."""

    confirmed_at_floor: float = number(
        0.8, "1", "probability from which a cause is confirmed where all causes together leave only noise",
        "another law could leave that too, but hardly by chance",
    )  # fmt: skip
    confirmed: float = number(
        0.98, "1", "the same where more is missing", "two wrong names in a hundred are the most that may be"
    )
    likely: float = number(
        0.5, "1", "probability of a cause and its rivals from which it is named if it surely helps at all",
        "likelier than none of these",
    )  # fmt: skip
    possible: float = number(
        0.2, "1", "the same where it surely brings what a cause must bring (acceptance.fall)",
        "below it four to one speak against the name",
    )  # fmt: skip
    rival: float = number(0.05, "1", "probability from which a rival is an alternative", "one in twenty")
    clear: float = number(
        0.8, "1", "share of the probability of a cause and its rivals, below which it is `one_of` them",
        "four to one over all rivals together",
    )  # fmt: skip


@dataclass(frozen=True)
class SizeSettings:
    """The interval of a cause's size, and the channel of which its gain speaks."""

    model_error: float = number(
        0.0025, "1", "relative error of the simulation itself in every size, one sigma",
        "measured between the simulation and the second bench in test/independent",
    )  # fmt: skip
    fall: float = number(
        1.02, "1", "ratio by which a channel's residual must fall for the gain to speak of that channel",
        "less is within what acceptance.matters calls nothing",
    )  # fmt: skip


@dataclass(frozen=True)
class NextRunSettings:
    """The run that is recommended where these data do not decide."""

    duration: float = number(
        12.0, "s", "of a run that separates a cause from its rivals", "three periods of 4 s"
    )
    separation: float = number(
        0.5, "1", "RMS of what a rival cannot follow, over the noise, that separates it",
        "the 3360 samples of 12 s at 280 Hz then lie 10 standard deviations above noise",
    )  # fmt: skip
    series_duration: float = number(
        60.0, "s", "of a run at another amplitude", "as long as a usual record"
    )
    series_top: float = number(
        60.0, "Hz", "upper end of its band", "above it the driver's limit of the slew leaves little amplitude"
    )
    visible: float = number(
        1.1, "1", "residual over the noise from which it is seen at that amplitude", "as floor.reached"
    )
    nearly: float = number(
        0.8, "1", "part of the wanted amplitude that the limits must leave",
        "with less the two amplitudes are too alike to compare",
    )  # fmt: skip


@dataclass(frozen=True)
class DiagnosisSettings:
    """What a diagnosis tries, and every number that steers its verdict.

    max_causes: causes at most, 1 or more; the search ends earlier where only noise is left. Beside four, the
    benchmark's records hold too little that is unexplained for a fifth.
    without: effects of the catalogue that are not to be tried.
    Raises ParameterError for a number below 1.
    """

    max_causes: int = MOST_CAUSES
    without: tuple[str, ...] = ()
    blocks: BlockSettings = BlockSettings()
    floor: FloorSettings = FloorSettings()
    acceptance: AcceptanceSettings = AcceptanceSettings()
    fits: FitSettings = FitSettings()
    pieces: PieceSettings = PieceSettings()
    forward: ForwardSettings = ForwardSettings()
    evidence: EvidenceSettings = EvidenceSettings()
    naming: NamingSettings = NamingSettings()
    sizes: SizeSettings = SizeSettings()
    next_run: NextRunSettings = NextRunSettings()

    def __post_init__(self) -> None:
        if self.max_causes < 1:
            raise ParameterError(f"max_causes = {self.max_causes}, expected 1 or more")
        object.__setattr__(self, "without", tuple(self.without))

    def listed(self) -> Iterator[Setting]:
        """Yield every number of the groups with its meaning, unit and reason."""
        for group in (f.name for f in fields(self) if f.name not in ("max_causes", "without")):
            values = getattr(self, group)
            for f in fields(values):
                yield Setting(f"{group}.{f.name}", getattr(values, f.name), **f.metadata)


DEFAULT = DiagnosisSettings()
