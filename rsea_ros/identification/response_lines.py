"""The result of every method of estimation: the sampled response line by line, with its doubt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rsea_ros.records.record import ComplexArray, FloatArray


@dataclass(frozen=True)
class Lines:
    """A sampled response, all shape (n,).

    frequency: Hz. response: output per held command. sd: of the complex response, widened for few degrees
    of freedom. coherence: 0 … 1. noise, distortion: RMS of the output in one line, see FrequencyResponse.
    """

    method: str
    frequency: FloatArray
    response: ComplexArray
    sd: FloatArray
    coherence: FloatArray
    noise: FloatArray | None = None
    distortion: FloatArray | None = None

    def up_to(self, highest: float) -> Lines:
        """Return the lines up to a frequency, Hz."""
        n = int(np.searchsorted(self.frequency, highest, side="right"))
        return Lines(
            method=self.method,
            frequency=self.frequency[:n],
            response=self.response[:n],
            sd=self.sd[:n],
            coherence=self.coherence[:n],
            noise=None if self.noise is None else self.noise[:n],
            distortion=None if self.distortion is None else self.distortion[:n],
        )


def widen(sd: FloatArray, freedom: FloatArray | float) -> FloatArray:
    """Return sd scaled so that the circle of radius 1.73 sd holds the truth in 95 % of cases.

    With the variance itself estimated from m = `freedom` complex values, |error|^2 / variance follows
    F(2, 2 m), which exceeds x with probability (1 + x / m)^-m; for a known variance with e^-x, so that its
    95 % point is -ln 0.05 = 1.73^2.
    """
    m = np.maximum(freedom, 1.0)
    quantile = m * (0.05 ** (-1.0 / m) - 1.0)
    result: FloatArray = sd * np.sqrt(quantile / -np.log(0.05))
    return result


def detrend(values: FloatArray) -> FloatArray:
    """Return values without their mean and slope."""
    place = np.linspace(-1.0, 1.0, len(values))
    slope = float(place @ values / (place @ place))
    result: FloatArray = values - values.mean() - slope * place
    return result
