"""A run that may be recommended: settings of an excitation that rig and driver allow, simulated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rsea_ros.errors import RseaError
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import drive_from
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_fields import END_NAMES
from rsea_ros.model.simulation import simulate_drive
from rsea_ros.records.record import Channel, FloatArray, Record

SLOWEST, FASTEST = 50.0, 1000.0
"""Hz, of the node excite."""
_TRIES, _CLOSER = 4, 0.98
"""How often an amplitude is brought down until a run is allowed; what it stays below the limit by then."""
_SHOWN = ("position", "velocity", "ft")


@dataclass(frozen=True)
class DriverLimits:
    """The defaults of the driver (config/nodes/driver.yaml), which excite has too: torque N m, slew N m/s.

    deflection: rad, of the spring. velocity: rad/s. ft: N m. power: W.
    """

    torque: float = 68.0
    slew: float = 10_000.0
    deflection: float = 0.0873
    velocity: float = 5.0
    ft: float = 110.0
    power: float = 250.0


@dataclass(frozen=True)
class AllowedRun:
    """An excitation by its settings, which excite has too, and the noise-free case of a rig under it.

    peak: the largest command, N m, or rad where positions command the rig.
    """

    kind: str
    settings: ExcitationSettings
    peak: float
    case: Case


def playable_rate(rate: float) -> float:
    """Return a rate, Hz, that excite has: a period of whole seconds is a whole number of its samples."""
    return min(max(float(round(rate)), SLOWEST), FASTEST)


def allowed_run(
    rig: Rig,
    like: Case,
    kind: str,
    settings: ExcitationSettings,
    peak: float,
    limits: DriverLimits | None = None,
) -> AllowedRun | None:
    """Return a run of at most a peak that stays within the limits in simulation; None where none does.

    like: the case of the present run, whose travel is the largest where nothing else bounds it. settings:
    amplitude and noise count by their ratio.
    """
    limits = limits or DriverLimits()
    bounds = _bounds(rig, like, limits)
    for _ in range(_TRIES):
        try:
            scaled, command = _scale(kind, settings, peak)
            case, outputs = _simulate(rig, like, command, settings.rate)
        except RseaError:
            return None
        share = _share(command, outputs, bounds, settings.rate)
        if share <= 1.0:
            return AllowedRun(kind, scaled, float(np.max(np.abs(command))), case)
        if not math.isfinite(share):
            return None
        peak *= _CLOSER / share
    return None


def _bounds(rig: Rig, like: Case, limits: DriverLimits) -> Mapping[str, float]:
    """Return the limits by simulated quantity; a rig commanded by positions bounds its own torque."""
    present: dict[str, float] = {
        n: float(np.nanmax(np.abs(y))) for n, y in like.measured.items() if n in ("position", "velocity")
    }
    if rig.loop is not None:
        return {"command": present.get("position", math.inf), **present}
    bounds = present | {
        "command": limits.torque, "slew": limits.slew, "velocity": limits.velocity, "power": limits.power,
    }  # fmt: skip
    if rig.rigid_spring:
        return bounds
    if rig.clamped == set(END_NAMES):
        return {**bounds, "position": limits.deflection, "ft": limits.ft}
    return {**bounds, "ft": min(limits.ft, limits.deflection * rig["spring.stiffness"])}


def _scale(kind: str, settings: ExcitationSettings, peak: float) -> tuple[ExcitationSettings, FloatArray]:
    """Return settings and command whose largest value is the peak: both grow with amplitude and noise."""
    largest = float(np.max(np.abs(excitation(kind, settings))))
    factor = peak / largest
    amplitude, noise = (_round_down(factor * value) for value in (settings.amplitude, settings.noise))
    scaled = replace(settings, amplitude=amplitude, noise=noise)
    return scaled, excitation(kind, scaled)


def _round_down(value: float) -> float:
    """Return a value with four digits, rounded towards zero, for a person to type."""
    if value == 0.0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.floor(value / unit + 1e-9) * unit:.4g}")


def _simulate(
    rig: Rig, like: Case, command: FloatArray, rate: float
) -> tuple[Case, Mapping[str, FloatArray]]:
    """Return a case with the rig's noise-free measurements, and all limited quantities."""
    t = np.arange(len(command)) / rate
    names = sorted({*like.measured, *filter(rig.measures, _SHOWN)})
    blank = {n: Channel(t + 1.0 / rate, np.zeros(len(t))) for n in names}
    drive = drive_from(Record({"command": Channel(t, command), **blank}))
    outputs = simulate_drive(rig, drive)
    shown = {n: outputs[n] for n in like.measured}
    case = Case(
        replace(drive, at={n: drive.at[n] for n in shown}, impulse={n: drive.impulse[n] for n in shown}),
        {n: blank[n].t for n in shown},
        shown,
        like.noise,
        {n: np.ones(len(t), bool) for n in shown},
    )
    return case, outputs


def _share(
    command: FloatArray, outputs: Mapping[str, FloatArray], bounds: Mapping[str, float], rate: float
) -> float:
    """Return the largest share of a limit that a run takes; not finite where it runs away."""
    around = np.concatenate([[0.0], command, [0.0]])
    peaks = {n: float(np.max(np.abs(y))) for n, y in outputs.items()}
    peaks["command"] = float(np.max(np.abs(command)))
    peaks["slew"] = rate * float(np.max(np.abs(np.diff(around))))
    peaks["power"] = float(np.max(np.abs(command * outputs["velocity"])))
    return max(peaks[n] / bound for n, bound in bounds.items() if n in peaks)
