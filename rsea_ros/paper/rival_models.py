"""Rival models of the paper: lumped ones.

The reflected rotor inertia is taken for an inertia of the chassis against the ground, J_eff = J_sc + J_m,
and the motor for a torque between ground and chassis: the housing's motion is left out. With both ends
clamped this changes T_p, Eqs. (2) and (3), and nothing in T_d, Eq. (1).

A rig with `train: lumped` and a free housing grounds the rotor only; its loads move. Fig. 18 can be read
either way (paper/figure_18.py).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.identification.identify import identify
from rsea_ros.model.prediction_errors import Comparison, predict
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import Record


@dataclass(frozen=True)
class HeldOutFit:
    """A rival on one held-out record.

    sensor: which end its F/T sensor is on. explained: share of the variance of its torque,
    1 - var(error) / var(measured), negative where no model would be better. fit_percent: %.
    rms_error, rms: of the error and of the measurement, N m.
    """

    sensor: str
    explained: float
    fit_percent: float
    rms_error: float
    rms: float


@dataclass(frozen=True)
class Rival:
    """A model by name with its fitted rig."""

    name: str
    rig: Rig
    held_out: tuple[HeldOutFit, ...]


def compare(
    rivals: Mapping[str, Rig], train: Record, holdout: Sequence[tuple[str, Record]]
) -> tuple[Rival, ...]:
    """Fit every rig to `train` and test it on held-out records, each with the end of its sensor.

    Nothing is fitted to the held-out records: a second sensor tests what the first one identified.
    """
    return tuple(_rival(name, rig, train, holdout) for name, rig in rivals.items())


def _rival(name: str, rig: Rig, train: Record, holdout: Sequence[tuple[str, Record]]) -> Rival:
    fitted = identify([train], rig).rig
    return Rival(name, fitted, tuple(test_on(fitted, end, record) for end, record in holdout))


def test_on(rig: Rig, end: str, record: Record) -> HeldOutFit:
    """Return how well a rig predicts the torque that a sensor on an end recorded."""
    comparison: Comparison = predict(replace(rig, ft_end=end), record)["ft"]
    measured = comparison.measured[comparison.counts]
    error = (comparison.predicted - comparison.measured)[comparison.counts]
    return HeldOutFit(
        sensor=end,
        explained=float(1.0 - np.var(error) / np.var(measured)),
        fit_percent=comparison.fit_percent,
        rms_error=comparison.rms_error,
        rms=float(np.std(measured)),
    )


def lumped_rig(rig: Rig) -> Rig:
    """Return the rig of the lumped model; every function of the model accepts it."""
    return replace(rig, name=f"{rig.name}, lumped", train="lumped", clamped=rig.clamped | {"housing_end"})
