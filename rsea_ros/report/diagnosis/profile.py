"""Where the residual is large: its RMS over the noise against load, speed, rotor angle and time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from rsea_ros.diagnosis.residual_analysis import edges_of, rms_in
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.identification.result import Overlay
from rsea_ros.model.extent import SKIPPED_START
from rsea_ros.records.record import UNITS, FloatArray

BINS = 16
_FEWEST = 4 * BINS


@dataclass(frozen=True)
class Profile:
    """The residual laid out against one respect.

    edges: of the bins in `unit`, shape (n + 1,). before, after: RMS over the noise, shape (n,).
    """

    what: str
    unit: str
    edges: FloatArray
    before: FloatArray
    after: FloatArray

    @property
    def contrast(self) -> float:
        """Largest over smallest RMS before: how much the residual depends on this respect."""
        return float(np.nanmax(self.before) / max(float(np.nanmin(self.before)), 1e-12))


def profiles(diagnosis: Diagnosis, channel: str) -> tuple[Profile, ...]:
    """Return a profile over every signal that the record has."""
    before, after = ({o.channel: o for o in overlays} for overlays in (diagnosis.before, diagnosis.after))
    if channel not in before:
        return ()
    overlay, noise = before[channel], diagnosis.noise_rms[channel]
    counted = _counted_samples(diagnosis, overlay)
    residuals = [((o[channel].measured - o[channel].simulated) / noise)[counted] for o in (before, after)]
    if counted.sum() < _FEWEST:
        return ()
    shown = []
    for what, unit, values, equal in _respects(diagnosis, before, overlay):
        edges = edges_of(values[counted], BINS, equal=equal)
        shown.append(Profile(what, unit, edges, *(rms_in(edges, values[counted], r) for r in residuals)))
    return tuple(shown)


def _counted_samples(diagnosis: Diagnosis, overlay: Overlay) -> FloatArray:
    """Return which samples count: neither those before the bench has settled nor faulty ones."""
    out = np.asarray(diagnosis.masked.get(overlay.channel, np.zeros(len(overlay.t), bool)))
    good: FloatArray = (overlay.t >= overlay.t[0] + SKIPPED_START) & ~out
    return good


def _respects(
    diagnosis: Diagnosis, measured: Mapping[str, Overlay], overlay: Overlay
) -> Iterator[tuple[str, str, FloatArray, bool]]:
    """Yield name, unit, value at each sample, and whether bins are equally wide (else equally full)."""
    load = "ft" if "ft" in measured else "motor_torque"
    if load in measured:
        yield "amplitude", UNITS[load], np.abs(_at(overlay.t, measured[load])), False
    if "velocity" in measured:
        yield "velocity", UNITS["velocity"], _at(overlay.t, measured["velocity"]), False
    ratio = diagnosis.extended_rig["gear.ratio"]
    if "position" in measured and ratio > 1.0:
        yield "angle", "rad", np.mod(_at(overlay.t, measured["position"]) * ratio, 2.0 * np.pi), True
    yield "time", "s", overlay.t - overlay.t[0], True


def _at(t: FloatArray, overlay: Overlay) -> FloatArray:
    return np.interp(t, overlay.t, overlay.measured)
