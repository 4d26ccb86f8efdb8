"""Settings of the run that is recommended where the data do not decide."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.diagnosis.settings.number import number


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
