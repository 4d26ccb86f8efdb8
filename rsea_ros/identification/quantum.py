"""The steps that a channel's values come in, from the values alone."""

from __future__ import annotations

import numpy as np

from rsea_ros.records.record import FloatArray

FEW = 0.2
"""Share of the samples: with more different values than that, a channel has no steps worth the name."""
_ON_GRID = 1e-3
"""Of a step: so near to whole numbers of steps all values must lie."""


def step_of(values: FloatArray) -> float:
    """Return the step of which all finite values are multiples, in their unit; 0 for none."""
    different = np.unique(values[np.isfinite(values)])
    if not 3 <= len(different) < FEW * len(values):
        return 0.0
    step = float(np.median(np.diff(different)))
    places = (different - different[0]) / step
    return step if np.max(np.abs(places - np.round(places))) <= _ON_GRID else 0.0
