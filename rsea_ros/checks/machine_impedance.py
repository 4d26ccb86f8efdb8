"""Findings on the machine behind the rig: its impedance, and what restores its position.

torque / position = Z(f) = K - J w^2 + i w b,    w = 2 pi f

Measured as Z_0 / R with Z_0 the rig's and R the torque that the rig's inverse model makes of the measured
motion over the torque that acted: the torque has far less noise than a motion differentiated twice.

The torque that acted, by least squares along the measured motion, without and with the restoring terms:

    T = J q'' + b q' + c sign(q') + T_0 (+ K q + G sin(q - q_0))
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.checks.channel_spectra import Quotient, quotient
from rsea_ros.checks.expected import Side
from rsea_ros.checks.finding import Finding
from rsea_ros.checks.gain_findings import RIGHT_RIG
from rsea_ros.checks.gains import inertia_spread
from rsea_ros.errors import RseaError
from rsea_ros.model.equations import mechanics
from rsea_ros.model.inverse import CUT_OFF, Motion, motion_from
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray, Record

_COHERENT = 0.5
_FEWEST, _MOST = 6, 0.4
"""Coherent lines that a fit needs: so many, and that share of those below the filter's edge."""
_MODEL_ERROR = 0.1
"""Of Z: what friction leaves of a linear fit."""
_SURE = 4.0
"""Sigmas."""
_INSIDE = 2.0
"""Times the lowest frequency that was measured: the machine swings at more, or its K is not seen."""
_FAR, _ELSEWHERE = 4.0, 4.0
"""Factor of the rig's inertia that is another machine's, and spreads that go with it."""
_STIFFER = 4.0
"""Times the rig's stiffness that is another machine's; a pendulum's falls with its swing, so less is none."""
_SHAPED = 0.35
"""Largest median of what the fit leaves of Z, over Z."""


@dataclass(frozen=True)
class ImpedanceFit:
    """K (N m/rad) and J (kg m^2) with one sigma each, and the median residual of the fit over Z."""

    stiffness: float
    stiffness_sd: float
    inertia: float
    inertia_sd: float
    left: float
    lowest: float

    @property
    def natural_frequency(self) -> float:
        """Return the frequency at which the machine would swing by itself, Hz; 0 where it would not."""
        return math.sqrt(max(self.stiffness / max(self.inertia, 1e-300), 0.0)) / (2.0 * math.pi)


def impedance_findings(side: Side | None, rig: Rig) -> list[Finding]:
    """Return the findings by which the machine differs from the rig: a spring or pendulum, another inertia.

    side: of the torque.
    """
    measured = None if side is None else impedance_of(side, rig)
    if measured is None or measured.left > _SHAPED or measured.inertia <= 0.0:
        return []
    m = mechanics(rig, linear_gravity=True)
    stiffness, inertia = float(m.stiffness[0, 0]), float(m.mass[0, 0])
    held = measured.stiffness - _SURE * measured.stiffness_sd > _STIFFER * stiffness
    if held and measured.natural_frequency > _INSIDE * measured.lowest:
        swing = f"a spring or pendulum holds the output: it swings at {measured.natural_frequency:.2g} Hz"
        return [_another("stiffness", measured.stiffness, "N m/rad", stiffness, swing)]
    factor = measured.inertia / inertia
    sure = measured.inertia > 2.0 * _SURE * measured.inertia_sd
    if sure and abs(math.log(factor)) > max(math.log(_FAR), _ELSEWHERE * inertia_spread(rig)):
        return [_another("inertia", measured.inertia, "kg m^2", inertia, f"{factor:.2g} times the rig's")]
    return []


def _another(key: str, value: float, unit: str, expected: float, detail: str) -> Finding:
    return Finding(
        "red",
        "wrong_rig",
        f"spring_end.{key}",
        value,
        unit,
        expected=f"{expected:.3g}",
        detail=detail,
        remedy=RIGHT_RIG,
    )


def impedance_of(side: Side, rig: Rig) -> ImpedanceFit | None:
    """Return the impedance that a record shows; None where too few lines are coherent."""
    q = quotient("motor_torque", side.t, side.p, side.y)
    m = mechanics(rig, linear_gravity=True)
    if q is None or m.order != 1:
        return None
    band = q.frequency < CUT_OFF
    keep = band & (q.coherence > _COHERENT)
    if np.count_nonzero(keep) < max(_FEWEST, _MOST * np.count_nonzero(band)):
        return None
    w = 2.0 * np.pi * q.frequency[keep]
    nominal = m.stiffness[0, 0] - m.mass[0, 0] * w**2 + 1j * w * m.damping[0, 0]
    return _fit(nominal / q.value[keep], w, q, q.sd[keep])


def _fit(z: FloatArray, w: FloatArray, q: Quotient, sd: FloatArray) -> ImpedanceFit:
    """Return K and J from the real part of Z, each line by its doubt."""
    doubt = np.abs(z) * np.hypot(sd, _MODEL_ERROR)
    rows = np.column_stack([np.ones(len(w)), -(w**2)])
    size = np.linalg.norm(rows / doubt[:, None], axis=0)
    inverse = np.linalg.pinv(rows / doubt[:, None] / size)
    stiffness, inertia = (inverse @ (z.real / doubt)) / size
    stiffness_sd, inertia_sd = np.linalg.norm(inverse, axis=1) / size
    misfit = np.abs(z.real - rows @ [stiffness, inertia]) / np.abs(z)
    return ImpedanceFit(
        stiffness=float(stiffness),
        stiffness_sd=float(stiffness_sd),
        inertia=float(inertia),
        inertia_sd=float(inertia_sd),
        left=float(np.median(misfit)),
        lowest=float(w[0]) / (2.0 * math.pi),
    )


_FALLS = 0.55
"""Of what is left of the torque: with a spring or pendulum that is there, less is left."""
_EDGE = 0.02
"""Of the record at either end, where the filter settles."""
_SHARP = 0.05
"""Of the speed's RMS: the width of its sign's step."""


def restoring_findings(record: Record, rig: Rig) -> list[Finding]:
    """Return the finding of a torque that follows the position, for a rig that has neither K nor gravity."""
    if rig["spring_end.stiffness"] or rig["spring_end.gravity"]:
        return []
    try:
        motion = motion_from(record)
    except (RseaError, ValueError):
        return []
    without, held = residual_shares(motion)
    if not held < _FALLS * without:
        return []
    return [
        Finding(
            "red",
            "wrong_rig",
            "spring_end.stiffness",
            100.0 * (1.0 - (held / without) ** 2),
            "%",
            expected="0",
            detail="of the torque that the rig leaves open follows the position: a spring or a pendulum",
            remedy=RIGHT_RIG,
        )
    ]


def residual_shares(motion: Motion) -> tuple[float, float]:
    """Return the share of the torque's RMS that is left without and with the restoring terms."""
    sign = np.tanh(motion.v / max(_SHARP * float(np.std(motion.v)), 1e-300))
    holding = [motion.q, np.sin(motion.q), np.cos(motion.q)]
    moving = [motion.a, motion.v, sign, np.ones_like(motion.v)]
    known = motion.counts if motion.counts.any() else np.ones(len(motion.t), bool)
    without, held = ([c[known] for c in columns] for columns in (moving, [*moving, *holding]))
    return _rms_left(without, motion.torque[known]), _rms_left(held, motion.torque[known])


def _rms_left(columns: list[FloatArray], torque: FloatArray) -> float:
    edge = int(_EDGE * len(torque))
    inside = slice(edge, len(torque) - edge)
    rows = np.column_stack(columns)[inside]
    rows = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    y = torque[inside]
    return float(np.std(y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]) / max(float(np.std(y)), 1e-300))
