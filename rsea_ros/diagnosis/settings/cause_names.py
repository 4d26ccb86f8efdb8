"""Settings of the names of accepted causes, and of the intervals of their sizes."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.diagnosis.settings.number import CALIBRATED, flat, number


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
        "is not confirmed although only noise is left (naming/signature.py)",
        "chance exceeds it for one right cause in 200; in simulated records 0 of 88 right causes did, "
        "and 6 of 8 drifts that were named for a wandering sensor",
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
        "(bench/model_doubt.py); coverage is measured on another bench (test/independent)",
    )  # fmt: skip
    fall: float = number(
        1.02, "1", "ratio by which a channel's residual must fall for the gain to speak of that channel",
        "less is within what acceptance.matters calls nothing",
    )  # fmt: skip
    widest: float = number(
        10.0, "1", "ratio of the ends of a size's interval from which a cause is not confirmed",
        "a law whose size is open by a factor of ten fits whatever is left",
    )  # fmt: skip
