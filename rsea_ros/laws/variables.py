"""The variables of laws on the steps of a record: speed, angles, deflection, load, command and time.

The motion is the measured one, smoothed: the simulation plus the response to the missing torque.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from rsea_ros.laws.injection import Injector
from rsea_ros.laws.memory import remember
from rsea_ros.laws.missing import MissingTorque
from rsea_ros.laws.terms import Term
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.inverse import Motion
from rsea_ros.model.rig import Rig
from rsea_ros.model.step import OUTPUTS
from rsea_ros.records.record import FloatArray


@dataclass(frozen=True)
class Variables:
    """Variables by their letters (terms.py) at instants `step` s apart, SI, shape (n,) each."""

    step: float
    letters: Mapping[str, FloatArray]

    def size(self, letter: str) -> float:
        """Return how large a variable gets, but for its rarest values."""
        return float(np.quantile(np.abs(self.letters[letter]), 0.995))

    def values(self, term: Term, shape: float) -> FloatArray:
        """Return a term along the record, for a coefficient of 1."""
        letters = dict(self.letters)
        if term.memory:
            letters["m"] = remember(term.memory, letters[term.remembers], self.step, shape, term.constant)
        return term.values(letters, shape)

    def shapes(self, term: Term) -> tuple[float, ...]:
        """Return the shapes to be tried of a term, SI; 0 for one that has none."""
        if not term.shape:
            return (0.0,)
        size = self.size(term.over) if term.over else 1.0
        return tuple(share * size for share in term.shapes)


def variables_of(injector: Injector, missing: MissingTorque) -> Variables:
    """Return the variables of a simulated record at the middle of each step."""
    rig, drive = injector.rig, injector.drive
    at = injector.middles
    base = 0.5 * (injector.base[1:] + injector.base[:-1])
    out = {n: base[:, k] for k, n in enumerate(OUTPUTS)}
    for n, answer in missing.answers.items():
        out[n] = out[n] + CubicSpline(missing.t, answer)(np.clip(at, 0.0, missing.t[-1]))
    command = base[:, OUTPUTS.index("motor_torque")] if rig.loop else drive.command
    return Variables(drive.step, _letters(rig, at, out["velocity"], out["position"], out["deflection"],
                                          out["ft"], command))  # fmt: skip


def variables_along(rig: Rig, motion: Motion) -> Variables:
    """Return the variables of a measured motion of a drive without a spring; its load is what it drives."""
    gravity = rig["spring_end.gravity"] * np.sin(motion.q + rig["spring_end.gravity_angle"])
    load = gravity + rig["spring_end.inertia"] * motion.a
    t, nothing = motion.t - motion.t[0], np.zeros(len(motion.t))
    return Variables(float(motion.t[1] - motion.t[0]),
                     _letters(rig, t, motion.v, motion.q, nothing, load, motion.torque))  # fmt: skip


def _letters(rig: Rig, t: FloatArray, w: FloatArray, q: FloatArray, d: FloatArray, load: FloatArray,
             u: FloatArray) -> dict[str, FloatArray]:  # fmt: skip
    h = d - q if rig.end_is_free("housing_end") else q - d
    letters = {"w": w, "q": q, "h": h, "theta": train_ratio(rig) * q, "d": d, "T": load, "u": u, "t": t,
               "share": t / max(float(t[-1]), 1e-9)}  # fmt: skip
    return {n: np.ascontiguousarray(v) for n, v in letters.items()}
