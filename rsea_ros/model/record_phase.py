"""Phases that differ from record to record, for example that of the mains."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import FloatArray, Record


def in_phase(rig: Rig, record: Record) -> Rig:
    """Return the rig with the phases that belong to this record."""
    for place, setting in enumerate(rig.effects):
        effect = effect_named(setting.name)
        for phase in (p.name for p in effect.parameters if p.per_record):
            if effect.claims.channel in record:
                rig = _with_parameters(rig, place, {phase: _phase(rig, place, phase, record)})
    return rig


def _phase(rig: Rig, place: int, phase: str, record: Record) -> float:
    """Return the phase (rad) of A sin(w t + phase) in a record's channel.

    It is that of the residual without the wave, projected on the wave and on itself a quarter period ahead.
    """
    effect = effect_named(rig.effects[place].name)
    channel, size = effect.claims.channel, effect.main
    without = simulate(_with_parameters(rig, place, {size.name: size.null}), record)[channel]
    residual = record[channel].y - without
    keep = np.isfinite(residual)

    def share(angle: float) -> float:
        wave: FloatArray = simulate(_with_parameters(rig, place, {phase: angle}), record)[channel] - without
        return float(residual[keep] @ wave[keep])

    return math.atan2(share(0.5 * math.pi), share(0.0))


def _with_parameters(rig: Rig, place: int, parameters: Mapping[str, float]) -> Rig:
    """Return the rig with some parameters of one of its effects changed."""
    effects = list(rig.effects)
    effects[place] = replace(effects[place], parameters={**effects[place].parameters, **parameters})
    return rig.with_effects(*effects)
