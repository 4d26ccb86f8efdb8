"""Every number that steers a verdict: its meaning, its unit, and why it has this value.

`identify` estimates noise and intervals by the same rules; their settings lie in identification/settings.py.

No setting: what happens to a record before any model (checks/, identification/fit.py), where fits
begin (initial_guess.py, identification/start.py), the steps of derivatives, and what
is only shown (residual_analysis.py, score.lost_above). Those numbers stand with their reasons where they
are used (docs/decisions/0180-which-numbers-are-settings.md).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import TypeVar

from rsea_ros.errors import ParameterError
from rsea_ros.identification import settings as setting
from rsea_ros.identification.result import AT_NOISE
from rsea_ros.identification.settings import IntervalSettings, NoiseSettings, Setting

T = TypeVar("T")
CHOSEN = "chosen on the benchmark; python -m bench diagnosis settings shows the outcomes over it"
CALIBRATED = (
    "fixed when the coefficients of naming/status.py were fitted: after a change, "
    "`python -m bench calibration fit`"
)


def flat(low: str, high: str) -> str:
    """Return the reason of a number whose outcomes do not change over a range."""
    return f"flat from {low} to {high} on the short records of docs/settings.md: between what was tried"


def number(value: T, unit: str, meaning: str, reason: str = CHOSEN) -> T:
    """Declare a setting of a group with its meaning, unit and reason."""
    return setting.number(value, unit, meaning, reason)


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
    response_left: float = number(
        0.5, "1", "share of a missed response (coherence^2) below which seeing it matters by itself"
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
    """Which effects a forward step fits, and how thoroughly."""

    piece_fits: int = number(
        9, "1", "effects that are fitted to the pieces after the screening", flat("3", "15")
    )
    full_fits: int = number(
        3, "1", "effects of each closeness that are fitted to all training blocks", flat("1", "6")
    )
    behind_first: float = number(4.0, "1", "of the best cost on pieces: how close the first of them must be")
    behind_next: float = number(1.1, "1", "of the best cost on pieces: how close the others must be")
    hope_one: float = number(
        0.98, "1", "of the current cost on pieces: no hope above it, while far", flat("0.8", "1")
    )
    hope_two: float = number(0.9, "1", "the same for two effects")
    hope_on_angle: float = number(0.5, "1", "the same for an effect simulated on the measured rotor angle")
    moved: float = number(0.02, "1", "change of what a channel leaves, from which a fit is repeated")
    alike: float = number(0.02, "1", "of the loss: a rival so close is refused for its size, not its fit")
    paired: int = number(3, "1", "effects with which pairs begin, and partners that each is tried with")
    paired_fits: int = number(2, "1", "pairs that are fitted to all training blocks")
    smaller_guess: float = number(
        0.1, "1", "share of a first guess that is tried where two linear steps from it led uphill",
        "a tenth of a typical size is nearly linear; without it mild effects were lost (bench/diagnosis)",
    )  # fmt: skip
    screening_steps: int = number(2, "1", "Gauss-Newton steps of an effect's screening, with old derivatives")
    screening_part: float = number(
        0.3, "1", "share of such a step that is tried where the whole one does not lower the cost"
    )
    clear: float = number(
        0.5, "1", "of the current cost on pieces: how much the first of a pair nearer the rig may leave"
    )
    nearer: float = number(
        0.5, "1", "of the prior's cost of the chosen effect: how near to the rig another keeps its values",
        "the second of a pair is sought beside those, where one effect fits only far from the rig",
    )  # fmt: skip
    causes_beside_a_pair: int = number(
        1, "1", "causes beside which pairs are tried", "beside more of them, a pair fits whatever is left"
    )


@dataclass(frozen=True)
class FitSettings:
    """How far candidates are fitted."""

    first_iterations: int = number(25, "1", "Gauss-Newton steps of the nominal model's first fit")
    iterations: int = number(12, "1", "steps of a fit that begins near its end")
    present_iterations: int = number(5, "1", "steps of the present model's fit to the short pieces")
    piece_iterations: int = number(25, "1", "steps of an effect's fit to the short pieces")
    full_iterations: int = number(6, "1", "steps of an effect's first fit to all training blocks")
    gain: float = number(2e-4, "1", "relative fall of the cost, at the noise, below which a fit is done")
    farthest: float = number(
        20.0, "1", "times the noise up to which that fall grows with the residual",
        "small falls of a residual far above the noise mean nothing",
    )  # fmt: skip
    step_error: float = number(
        0.05, "1", "of the noise: change by half a step from which a model is simulated on shorter ones",
        "at 0.25 a delay that moved the steps off the commands paid for itself, and was confirmed",
    )  # fmt: skip
    final_gain: float = number(
        1e-6, "1", "the same for the models that are tested", "far below the doubt of a parameter"
    )


@dataclass(frozen=True)
class BlockSettings:
    """The blocks of a record, and the coherence over them that shows a missed response (score.py)."""

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
class PieceSettings:
    """The short pieces of the training blocks on which effects are screened."""

    run_up: float = number(
        0.5, "s", "simulated and not compared before a piece", "the measured state decays within it"
    )
    enough: float = number(14.0, "s", "data in all pieces, half of them spread evenly, half at the worst")


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
    decays: float = number(
        4.0, "1", "time constants of the rig's slowest motion that a run-up lasts at least",
        "after 3 a sound rig with two swinging ends is at its floor; slots are as long, so there are fewer",
    )  # fmt: skip


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
class EvidenceSettings:
    """The features of a cause's probability (naming/), and the choice of its rivals."""

    parts: int = number(4, "1", "parts of amplitude and of time, for the shape of a law", CALIBRATED)
    bands: int = number(6, "1", "frequency bands, for the shape of a law", CALIBRATED)
    knots: tuple[float, ...] = number(
        (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0), "1",
        "quantiles of a regressor's size between which the flexible law is straight, each sign for itself",
        f"six pieces a sign, finer at both ends, where friction and stops act; {CALIBRATED}",
    )  # fmt: skip
    lags: tuple[int, ...] = number(
        (1, 2, 4, 8), "1", "samples by which the flexible law looks back, for a cause that is a time",
        f"doubling, to 29 ms at 280 Hz; {CALIBRATED}",
    )  # fmt: skip
    least_contribution: float = number(
        1e-5, "1", "power of a contribution over that of the residual, below which a cause changes nothing",
        "a cause lowers the residual's power by no more than its contribution's; the least gain that is "
        "named is 100 times as much",
    )  # fmt: skip
    least_spread: float = number(
        3e-3, "1", "spread of lambda that two right simulations of one law have", CALIBRATED
    )
    most_spread: float = number(3.0, "1", "spread of lambda above which it says no more", CALIBRATED)
    surest: float = number(
        4.0, "1", "log odds among rivals above which they say no more: all may be wrong", CALIBRATED
    )
    least_weight: float = number(
        0.02, "1", "weight among all that was tried in a cause's place, from which an effect is a rival",
        CALIBRATED,
    )  # fmt: skip
    close_weight: float = number(
        1e-6, "1", "the same, from which an effect is fitted to the end before it is weighed",
        "27 in twice the log likelihood, which the last steps of a long fit were seen to bring",
    )  # fmt: skip
    most_rivals: int = number(3, "1", "rivals of a cause that are weighed", CALIBRATED)


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
    """The interval of a cause's size, and the channel of its gain."""

    model_error: float = number(
        0.0025, "1", "relative error of the simulation itself in every size, one sigma",
        "fits to MuJoCo's play of the same bench deviate by 0.10 % RMS, 0.64 % at most "
        "(python -m bench diagnosis model_doubt); coverage is measured on another bench (test/independent)",
    )  # fmt: skip
    fall: float = number(
        1.02, "1", "ratio by which a channel's residual must fall for the gain to speak of that channel",
        "less is within what acceptance.matters calls nothing",
    )  # fmt: skip
    widest: float = number(
        10.0, "1", "ratio of the ends of a size's interval from which a cause is not confirmed",
        "a law whose size is open by a factor of ten fits whatever is left",
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
    series_duration: float = number(60.0, "s", "of a run at another amplitude", "as long as a usual record")
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
    fits: FitSettings = field(default_factory=FitSettings)
    stretches: StretchSettings = field(default_factory=StretchSettings)
    pieces: PieceSettings = field(default_factory=PieceSettings)
    forward: ForwardSettings = field(default_factory=ForwardSettings)
    evidence: EvidenceSettings = field(default_factory=EvidenceSettings)
    naming: NamingSettings = field(default_factory=NamingSettings)
    sizes: SizeSettings = field(default_factory=SizeSettings)
    next_run: NextRunSettings = field(default_factory=NextRunSettings)
    noise: NoiseSettings = field(default_factory=NoiseSettings)
    intervals: IntervalSettings = field(default_factory=IntervalSettings)

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
