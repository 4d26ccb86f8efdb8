"""Records of simulated benches whose true values are drawn from the rig's own spread."""

from __future__ import annotations

import numpy as np

from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

RATE = 280.0


def bench(name: str, seed: int) -> tuple[Rig, Rig]:
    """Return a rig as its file has it, and the true one, values off by up to two sigma."""
    nominal, rng = load_rig(name), np.random.default_rng(seed)
    off = {n: nominal.spread(n) * np.clip(rng.standard_normal(), -2.0, 2.0) for n in nominal.free()}
    return nominal, nominal.with_values({n: nominal[n] * np.exp(d) for n, d in off.items()})


def record_bench(
    true: Rig, seed: int, duration: float = 10.0, kind: str = "white_noise", **settings
) -> Record:
    """Return what the sensors of a bench log."""
    u = excitation(
        kind, ExcitationSettings(rate=RATE, duration=duration, seed=seed, amplitude=15.0, **settings)
    )
    return synthesize(true, Channel(np.arange(len(u)) / RATE, u), seed=seed)


def only(record: Record, *names: str) -> Record:
    """Return the record with the command and these channels."""
    return Record({n: record[n] for n in ("command", *names)}, source=record.source)
