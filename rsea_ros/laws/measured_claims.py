"""The claims in a law's file, measured in simulation on the rig that it was learnt on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rsea_ros.effects.effect import Claims, Effect, Parity
from rsea_ros.identification.problem import Case
from rsea_ros.laws.law import Law
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.records.record import FloatArray

_LONGEST = 10.0
"""s of the record that are simulated."""
_WHOLE = 0.12
"""How near to a whole number an exponent must be, at every amplitude, to be one."""
_SHARES = (0.3, 0.6, 1.2)
"""Of the record's amplitude."""
_ODD, _EVEN = 1e-7, 0.95


def claims_of(law: Law, effect: Effect, rig: Rig, case: Case) -> Claims:
    """Return channel, parity, exponent and passivity of a law; along a measured motion only the last."""
    passive = bool(law.parts) and law.place == "gear" and all(p.term.is_drag for p in law.parts)
    drive = case.drive
    if not isinstance(drive, Drive) or rig.loop is not None:
        return Claims("motor_torque", "neither", None, passive)
    drive = _beginning(drive)
    forward, backward = (_change(law, effect, rig, drive, a) for a in (1.0, -1.0))
    shown = {n: _rms(v) / case.noise[n] for n, v in forward.items() if n in case.noise}
    channel = max(shown, key=lambda n: shown[n])
    odd, even = (_rms(forward[channel] + s * backward[channel]) for s in (-1.0, 1.0))
    share = even / max(odd + even, 1e-300)
    parity: Parity = "odd" if share < _ODD else "even" if share > _EVEN else "neither"
    sizes = [_rms(_change(law, effect, rig, drive, a)[channel]) for a in _SHARES]
    exponents = np.diff(np.log2(np.maximum(sizes, 1e-300)))
    whole = float(np.rint(exponents.mean()))
    power = whole if np.abs(exponents - whole).max() < _WHOLE else None
    return Claims(channel, parity, power, passive)


def _beginning(drive: Drive) -> Drive:
    steps = min(len(drive.command), int(_LONGEST / drive.step))
    kept = {n: at[at <= steps] for n, at in drive.at.items()}
    impulse = {n: drive.impulse[n][: len(at)] for n, at in kept.items()}
    still = replace(drive, initial=(0.0, 0.0), restarts=())
    return replace(still, command=drive.command[:steps], at=kept, impulse=impulse)


def _change(law: Law, effect: Effect, rig: Rig, drive: Drive, factor: float) -> Mapping[str, FloatArray]:
    """Return the change of every channel by the law, under the command times a factor."""
    scaled = replace(
        drive, command=factor * drive.command, impulse={n: factor * v for n, v in drive.impulse.items()}
    )
    setting = EffectSetting(effect.name, law.parameters)
    linear = rig.with_effects()
    without, with_it = (simulate_drive(r, scaled) for r in (linear, linear.with_effects(setting)))
    return {n: with_it[n] - without[n] for n in without}


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
