"""The moving-output test (paper, section 3.2.2) on a simulated bench whose values the models do not know.

The bench's free values differ from the rig's by draws from the rig's own spread; the command is the paper's
white noise of 30 N m, half of it for the fit and half held out. The lumped model is fitted with loose
priors, so that only its structure limits it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.frequency_response import estimate_response
from rsea_ros.identification.result import FrequencyResponse
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.paper.rival_models import Rival, compare, lumped_rig
from rsea_ros.records.record import Channel, Record

NOISE = 30.0
"""N m, standard deviation (the paper prints N)."""
RATE, DURATION = 280.0, 160.0
_PART = 0.5
"""Of the rig's spread: how far the bench lies from what the rig states, one sigma."""

_LOOSE = 0.3
"""Relative spread, one sigma: thousands of samples outweigh it."""

Bag = Callable[[str, Record], Record]
"""Takes a record through a bag: name and record in, what is read back out."""


@dataclass(frozen=True)
class MovingOutput:
    """rivals: unlumped and lumped, fitted. responses: measured, F/T per command."""

    rivals: tuple[Rival, ...]
    responses: Mapping[str, FrequencyResponse]


def moving_output(
    rig: Rig, bag: Bag, *, duration: float = DURATION, seed: int = 5, channels: tuple[str, ...] = ("ft",)
) -> MovingOutput:
    """Run the test on the bench of a rig, with a sensor at each end where the rig has a proximal spring.

    channels: used by the fit beside the command; the paper had the F/T sensor alone.
    """
    true_rig = draw(rig, seed)
    values = excitation(
        "white_noise", ExcitationSettings(rate=RATE, duration=duration, amplitude=NOISE, seed=seed)
    )
    command = Channel(np.arange(len(values)) / RATE, values)
    ends = ["spring_end", *(["housing_end"] if "proximal_spring.stiffness" in rig.quantities else [])]
    records = {end: bag(f"{rig.name}_{end}", _record(true_rig, end, command, seed)) for end in ends}
    middle = 0.5 * duration
    train = _only(records["spring_end"].between(0.0, middle), channels)
    holdout = [(end, record.between(middle, duration + 1.0)) for end, record in records.items()]
    rivals = compare({"unlumped": rig, "lumped": loosen(lumped_rig(rig))}, train, holdout)
    return MovingOutput(rivals, {end: estimate_response(r, "ft") for end, r in records.items()})


def draw(rig: Rig, seed: int) -> Rig:
    """Return the rig with its free values drawn from half their spread, log-normal."""
    rng = np.random.default_rng(seed)
    factors = {n: float(np.exp(_PART * rig.spread(n) * rng.standard_normal())) for n in rig.free()}
    return rig.with_values({n: rig[n] * factor for n, factor in factors.items()})


def loosen(rig: Rig) -> Rig:
    """Return the rig with priors on its free values that hold nothing back."""
    wide = {n: replace(rig.quantities[n], spread=_LOOSE) for n in rig.free()}
    return replace(rig, quantities={**rig.quantities, **wide})


def _record(true_rig: Rig, end: str, command: Channel, seed: int) -> Record:
    return synthesize(replace(true_rig, ft_end=end), command, seed=seed + len(end))


def _only(record: Record, channels: tuple[str, ...]) -> Record:
    return replace(record, channels={n: c for n, c in record.channels.items() if n in ("command", *channels)})
