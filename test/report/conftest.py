"""An identification made by hand from a simulated record, so that reports are tested apart from the fit."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.identification.excitation import Settings, excitation
from rsea_ros.identification.frequency_response import estimate_response
from rsea_ros.identification.result import Identification, Overlay, ParameterEstimate
from rsea_ros.model import outputs
from rsea_ros.model.response import frequency_response
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.signals import Channel

DURATION, RATE = 160.0, 280.0


@pytest.fixture(scope="session")
def identification() -> Identification:
    rig = load_rig("paper_high_impedance")
    u = excitation("chirp", Settings(rate=RATE, duration=DURATION))
    record = synthesize(rig, Channel(np.arange(len(u)) / RATE, u), seed=11)
    simulated, sensors = simulate(rig, record), ("ft", "position", "velocity")
    responses = tuple(estimate_response(record, n) for n in ("ft", "position"))
    what = (outputs.distal(rig), outputs.position())
    return Identification(
        rig=rig,
        sources=("runs/bench & <friends>",),
        duration=DURATION,
        rate=RATE,
        parameters=(
            ParameterEstimate(
                "rotor.reflected_inertia", 0.95312, "kg m^2", (0.95301, 0.95323), 0.953, 0.3, 0.99
            ),
            ParameterEstimate("spring.damping", 2.9, "N m s/rad", (-np.inf, np.inf), 3.0, 0.5, 0.1),
            ParameterEstimate("clock.ft", 3e-6, "s", (-1e-6, 7e-6), 0.0, 1e-4, 0.99),
        ),
        correlation=np.array([[1.0, 0.1, 0.0], [0.1, 1.0, np.nan], [0.0, np.nan, 1.0]]),
        residual_rms={n: float(np.std(record[n].y - simulated[n])) for n in sensors},
        noise_rms={"ft": 0.03, "position": 6.2e-6, "velocity": 2.1e-4},
        fit_percent={
            n: 100.0 * (1.0 - float(np.std(record[n].y - simulated[n]) / np.std(record[n].y)))
            for n in sensors
        },
        responses=responses,
        models=tuple(frequency_response(rig, o, r.frequency) for o, r in zip(what, responses, strict=True)),
        overlays=tuple(Overlay(n, record[n].t, record[n].y, simulated[n]) for n in sensors),
        statements=("spring.damping is not identifiable from these data.",),
    )
