"""The numbers of the noise estimate: they steer verdicts too, and no setting moves them."""

from __future__ import annotations

from rsea_ros.diagnosis.settings import Setting
from rsea_ros.identification import coloured, noise, noise_level

NOISE_NUMBERS = (
    Setting(
        "noise.top_from", noise.TOP_OF_BAND[0], "1", "of half the rate: noise is read off above it",
        "what follows the command is taken away; a torque-driven actuator hardly moves there",
    ),
    Setting(
        "noise.top_to", noise.TOP_OF_BAND[1], "1", "of half the rate: noise is read off below it",
        "with noise.top_from a share of 0.36 of the lines, of which the median is taken",
    ),
    Setting(
        "noise.flat", noise.FLAT, "1", "ratio of the powers of its halves up to which it is flat",
        "a filter of second order makes 2.5 of it",
    ),
    Setting(
        "noise.slower", noise.SLOWER, "1", "of the command's rate: below it the rig's statement counts",
        "the command's upper half is folded over the band",
    ),
    Setting(
        "noise.filtered", noise.FILTERED, "1", "of the noise that a rig states: the least that is believed",
        "less is a filter's work, not a better sensor's",
    ),
    Setting(
        "noise.above", noise_level.ABOVE, "1", "residual over the noise above which it may be coloured noise",
        "as floor.only_noise",
    ),
    Setting(
        "noise.sure", noise_level.SURE, "1", "standard deviations above the white part that make it coloured",
        "chance reaches 4 in one of 30 000 channels",
    ),
    Setting(
        "noise.fewest", coloured.FEWEST, "1", "samples from which coloured noise is looked for",
        "of fewer, noise and misfit look alike",
    ),
    Setting(
        "noise.shape", coloured.SHAPE, "1", "standard deviations of a band off a falling spectrum",
        "noise reaches 3.5 in 300 records",
    ),
    Setting(
        "noise.unsteady", coloured.UNSTEADY, "1", "variance of the power in time, over that of steady noise",
        "noise reaches 2.3",
    ),
    Setting(
        "noise.shared", coloured.SHARED, "1", "share of the power that is coherent with another signal",
        "chance reaches 0.17, effects 0.9",
    ),
    Setting(
        "noise.slow", coloured.SLOW, "1", "power below 0.25 Hz over that from 0.3 to 1 Hz", "noise reaches 3"
    ),
    Setting(
        "noise.lasting", coloured.LASTING, "1", "share of the power in a constant and a trend",
        "noise reaches 0.03, a drift has most of it",
    ),
    Setting(
        "noise.spiky", coloured.SPIKY, "1", "excess kurtosis of the whitened residual",
        "noise reaches 0.1, knocks have more than 10",
    ),
)  # fmt: skip
"""By name: value, unit, meaning and reason, as of the settings. Up to the last seven, a residual is noise."""
