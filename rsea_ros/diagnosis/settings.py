"""The numbers on which a name hangs: their meaning, their unit, and why they have these values.

No setting: how far fits go and where they begin, what is fixed with the coefficients of a probability, the
noise that `check` and `identify` estimate alike, what is only shown. Those numbers stand with their reasons
where they are used (docs/decisions/0354-a-setting-is-what-a-name-hangs-on.md).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple, TypeVar

from rsea_ros.errors import ParameterError
from rsea_ros.identification.result import AT_NOISE

T = TypeVar("T")
CHOSEN = "chosen on the benchmark; python -m bench diagnosis settings shows the outcomes over it"


class Setting(NamedTuple):
    """One setting as a report shows it. name: `group.field`."""

    name: str
    value: Any
    unit: str
    meaning: str
    reason: str


def flat(low: str, high: str) -> str:
    """Return the reason of a number whose outcomes do not change over a range."""
    return f"flat from {low} to {high} on the short records of docs/settings.md: between what was tried"


def number(value: T, unit: str, meaning: str, reason: str = CHOSEN) -> T:
    """Declare a field of a group of settings, a frozen dataclass, with its meaning, unit and reason."""
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "reason": reason})


@dataclass(frozen=True)
class AcceptanceSettings:
    """When a candidate is better than another on the validation blocks."""

    doubt: float = number(
        0.025, "1", "quantile of the bootstrap of the gain that must lie above zero", "95 %, two-sided"
    )
    resamples: int = number(
        1000, "1", "draws of every bootstrap over blocks",
        "25 of them lie beyond the quantile: it is known to a fifth",
    )  # fmt: skip
    price: float = number(
        2.0, "1", "loss that each parameter must bring", "what a useless one gains (Akaike 1974)"
    )
    matters: float = number(
        0.02, "1", "fall of some channel's residual below which a gain does not matter", flat("0.005", "0.1")
    )
    fall: float = number(
        0.05, "1", "fall of some channel's residual that one more cause must bring",
        f"{flat('0.03', '0.3')}; several small causes overlap on a real machine",
    )  # fmt: skip
    fall_in_doubt: float = number(
        0.3, "1", "fall of the worst channel for a pair, or a third cause that leaves much",
        f"{flat('0.1', '0.5')}; these fit whatever is left, so they must bring six times as much",
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
class ForwardSettings:
    """Which effects a forward step fits."""

    piece_fits: int = number(
        9, "1", "effects that are fitted to the pieces after the screening", flat("3", "15")
    )
    full_fits: int = number(
        3, "1", "effects of each closeness that are fitted to all training blocks", flat("1", "6")
    )
    behind_first: float = number(4.0, "1", "of the best cost on pieces: how close the first of them must be")


@dataclass(frozen=True)
class BlockSettings:
    """The blocks of a record."""

    longest: float = number(
        1.0, "s", "length of a block", "longer than a bench's memory: blocks are independent"
    )
    shortest: float = number(
        0.25, "s", "length of a block below which short records have fewer blocks",
        "every part of a short sweep is in training, validation and test",
    )  # fmt: skip
    enough: int = number(
        120, "1", "blocks; a record with fewer of the longest is cut into shorter ones",
        "a quarter of them, 30, test: enough for a bootstrap over blocks",
    )  # fmt: skip


@dataclass(frozen=True)
class StretchSettings:
    """The stretches of a long record to which models are fitted and on which they are tested."""

    enough: float = number(
        200.0, "s", "of all records that are simulated, run-ups included; longer records are cut",
        "10 min at 280 Hz are diagnosed within a minute; more data narrow an interval by half at most",
    )  # fmt: skip
    samples: int = number(
        170_000, "1", "samples of the fastest channel that are used, at one per command",
        "160 s at 1 kHz and a little are diagnosed within 1.5 GB",
    )  # fmt: skip
    blocks: int = number(
        16, "1", "blocks in a row at least, a multiple of four", "every one holds all sets in their shares"
    )
    run_up: float = number(
        4.0, "s", "simulated and not compared before a stretch, at least", "friction and play settle in it"
    )


@dataclass(frozen=True)
class FloorSettings:
    """Levels of a residual: RMS over the noise of its channel."""

    only_noise: float = number(
        1.04,
        "1",
        "below it in every channel the search ends",
        "4 standard deviations of a white residual at 80 s of 280 Hz (noise_level.py)",
    )
    reached: float = number(
        AT_NOISE, "1", "up to it on the test blocks a channel has reached its floor",
        "at 1.05 a record with nothing wrong is unexplained; no change up to 1.4 (docs/settings.md)",
    )  # fmt: skip
    far: float = number(
        5.0, "1", "from it on, in the worst channel, a model is far from the floor",
        "the residual is not noise there: priors mean little, and more parameters always gain a little",
    )  # fmt: skip


@dataclass(frozen=True)
class NamingSettings:
    """The probabilities from which a cause is named, by status (naming/status.py)."""

    confirmed_at_floor: float = number(
        0.8, "1", "probability from which a cause is confirmed where all causes together leave only noise",
        "another law could leave that too, but hardly by chance; at 0.9 a mild right cause is no more than "
        "leading (docs/settings.md)",
    )  # fmt: skip
    confirmed: float = number(
        0.98, "1", "the same where more is missing",
        f"{flat('0.8', '0.995')}; two wrong names in a hundred are the most that may be",
    )  # fmt: skip
    likely: float = number(
        0.5, "1", "probability of a cause and its rivals from which it is named if it surely helps at all",
        "likelier than none of these",
    )  # fmt: skip
    possible: float = number(
        0.2, "1", "the same where it surely brings what a cause must bring (acceptance.fall)",
        "below it four to one speak against the name",
    )  # fmt: skip
    rival: float = number(0.05, "1", "probability from which a rival is an alternative", "one in twenty")
    carried: float = number(
        2.6, "1", "standard deviations by which a cause's misfit lasts from block to block, above which it "
        "is not confirmed although only noise is left, where its size wanders by more than two right "
        "simulations differ (sizes.model_error)",
        "chance exceeds it for one right cause in 200",
    )  # fmt: skip
    clear: float = number(
        0.8, "1", "share of the probability of a cause and its rivals, below which it is `one_of` them",
        "four to one over all rivals together",
    )  # fmt: skip


@dataclass(frozen=True)
class SizeSettings:
    """The interval of a cause's size."""

    model_error: float = number(
        0.0025, "1", "relative error of the simulation itself in every size, one sigma",
        "fits to MuJoCo's play of the same bench deviate by 0.10 % RMS, 0.64 % at most "
        "(decision 387); coverage is measured on another bench (test/independent)",
    )  # fmt: skip
    widest: float = number(
        10.0, "1", "ratio of the ends of a size's interval from which a cause is not confirmed",
        "a law whose size is open by a factor of ten fits whatever is left",
    )  # fmt: skip


MOST_CAUSES = 4


@dataclass(frozen=True)
class DiagnosisSettings:
    """The effects that a diagnosis tries, and every number that steers its verdict.

    max_causes: the most causes, 1 or more; the search ends earlier where only noise is left. Four causes
    leave too little of the benchmark's records unexplained for a fifth.
    without: effects of the catalogue that are not tried.
    Raises ParameterError for a number below 1.
    """

    max_causes: int = MOST_CAUSES
    without: tuple[str, ...] = ()
    blocks: BlockSettings = field(default_factory=BlockSettings)
    floor: FloorSettings = field(default_factory=FloorSettings)
    acceptance: AcceptanceSettings = field(default_factory=AcceptanceSettings)
    stretches: StretchSettings = field(default_factory=StretchSettings)
    forward: ForwardSettings = field(default_factory=ForwardSettings)
    naming: NamingSettings = field(default_factory=NamingSettings)
    sizes: SizeSettings = field(default_factory=SizeSettings)

    def __post_init__(self) -> None:
        if self.max_causes < 1:
            raise ParameterError(f"max_causes = {self.max_causes}, expected 1 or more")
        object.__setattr__(self, "without", tuple(self.without))

    def numbers(self) -> Iterator[Setting]:
        """Yield every number of the groups with its meaning, unit and reason."""
        for group in (f.name for f in fields(self) if f.name not in ("max_causes", "without")):
            values = getattr(self, group)
            for f in fields(values):
                yield Setting(f"{group}.{f.name}", getattr(values, f.name), **f.metadata)


DEFAULT = DiagnosisSettings()
