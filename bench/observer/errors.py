"""RMS errors of the estimated torques against the truth of the simulated bench."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bench.observer.lacks import chirp
from bench.observer.truth import Truth, true_run
from rsea_ros.model.observer import Observer, observe
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.paper.rival_models import lumped_rig

RATE, SECONDS, SETTLE = 280.0, 8.0, 0.5
RIGS = ("paper_high_impedance", "paper_moving_output", "prototype_knee", "separate_stiffnesses",
        "two_moving_outputs", "cycloidal")  # fmt: skip
"""All rigs of config/rigs that have a spring; the last one has no F/T sensor, and backlash."""


def errors(model: Rig, truth: Truth) -> tuple[float, float]:
    """Return the RMS errors of T_d and T_p, N m."""
    observer = Observer(model, duration=SECONDS)
    _, estimates = observe(observer, truth.record)
    skip = round(SETTLE * RATE)
    distal, proximal = (
        float(np.sqrt(np.mean((estimates[skip:, k] - true[skip:]) ** 2)))
        for k, true in enumerate((truth.distal, truth.proximal))
    )
    return distal, proximal


def rigs() -> Iterator[str]:
    """Compare the unlumped with the lumped observer on every rig with a spring.

    The lumped one takes encoder and F/T, which contradict each other there, or the F/T alone.
    """
    heads = f"{'unlumped T_d':>14}{'T_p':>9}{'lumped T_d':>12}{'T_p':>9}{'by ft T_d':>12}{'T_p':>9}"
    yield f"{'RMS error, N·m':24}{'T_p itself':>11}{heads}"
    for name in RIGS:
        rig = load_rig(name)
        truth = true_run(rig, chirp(RATE, SECONDS, (12.0, 3.0), 1), RATE, seed=2)
        size = float(np.sqrt(np.mean(truth.proximal**2)))
        unlumped, other = errors(rig, truth), errors(lumped_rig(rig), truth)
        line = f"{name:24}{size:11.3f}{unlumped[0]:14.4f}{unlumped[1]:9.4f}{other[0]:12.3f}{other[1]:9.3f}"
        if "ft" in rig.sensors:
            blind = replace(
                lumped_rig(rig), sensors={n: s for n, s in rig.sensors.items() if n != "position"}
            )
            by_ft = errors(blind, truth)
            line += f"{by_ft[0]:12.3f}{by_ft[1]:9.3f}"
        yield line
