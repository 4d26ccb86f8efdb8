"""Numbers that steer a result, each with meaning, unit and reason: here those of noise and intervals."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")


class Setting(NamedTuple):
    """One setting as a report shows it. name: `group.field`."""

    name: str
    value: Any
    unit: str
    meaning: str
    reason: str


def number(value: T, unit: str, meaning: str, reason: str) -> T:
    """Declare a field of a group of settings, a frozen dataclass, with its meaning, unit and reason."""
    described = {"unit": unit, "meaning": meaning, "reason": reason}
    return field(default=value, metadata=described)


@dataclass(frozen=True)
class NoiseSettings:
    """The noise that a record shows (noise.py), that of a residual (noise_level.py), and its colour.

    A residual is noise, however large, if it stays below every one of the last six.
    """

    top_from: float = number(
        0.62, "1", "of half the rate: noise is read off above it",
        "what follows the command is taken away; a torque-driven actuator hardly moves there",
    )  # fmt: skip
    top_to: float = number(
        0.98, "1", "of half the rate: noise is read off below it",
        "with noise.top_from a share of 0.36 of the lines, of which the median is taken",
    )  # fmt: skip
    flat: float = number(
        2.0, "1", "ratio of the powers of the two halves of that band, up to which it is flat",
        "a filter of second order makes 2.5 of it",
    )  # fmt: skip
    slower: float = number(
        0.9, "1", "of the command's rate: of a channel below it the rig's statement counts",
        "the command's upper half is folded over the band",
    )  # fmt: skip
    filtered: float = number(
        0.1, "1", "of the noise that a rig states: the least that is believed",
        "less is a filter's work, not a better sensor's",
    )  # fmt: skip
    above: float = number(
        1.04, "1", "RMS of a residual over the noise, above which it may be coloured noise",
        "as floor.only_noise",
    )  # fmt: skip
    sure: float = number(
        4.0, "1", "standard deviations of the white part, above which a residual counts as coloured",
        "chance reaches 4 in one of 30 000 channels",
    )  # fmt: skip
    fewest: int = number(
        1500, "1", "samples from which coloured noise is looked for", "of fewer, noise and misfit look alike"
    )
    shape: float = number(
        5.0, "1", "standard deviations by which a band may lie off a falling spectrum",
        "noise reaches 3.5 in 300 records",
    )  # fmt: skip
    unsteady: float = number(
        4.0, "1", "variance of the power over time, over that of stationary noise", "noise reaches 2.3"
    )
    shared: float = number(
        0.2, "1", "share of a band's power that is coherent with another signal",
        "chance reaches 0.17, effects 0.9",
    )  # fmt: skip
    slow: float = number(
        6.0, "1", "power density below 0.25 Hz over that from 0.3 to 1 Hz",
        "noise reaches 3; blocks of a second must be independent",
    )  # fmt: skip
    lasting: float = number(
        0.1, "1", "share of the power in a constant and a trend",
        "noise reaches 0.03, a drift has most of it",
    )  # fmt: skip
    spiky: float = number(
        1.0, "1", "excess kurtosis of the whitened residual", "noise reaches 0.1, knocks have more than 10"
    )


NOISE = NoiseSettings()


@dataclass(frozen=True)
class IntervalSettings:
    """The blocks of the sandwich covariance, and its correction for a small number of them."""

    block: float = number(
        1.0, "s", "residuals further apart than this are taken as independent",
        "longer than a bench's memory, as blocks.longest",
    )  # fmt: skip
    most_corrected: float = number(
        4.0, "1", "largest factor n / (n - p) on the variance, for n blocks and p unknowns",
        "an interval twice as wide: with fewer than 4/3 p blocks the factor runs away",
    )  # fmt: skip


INTERVALS = IntervalSettings()
