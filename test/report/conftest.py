"""Inputs for the tests of reports: an identification made by hand, a real diagnosis, and a browser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from msg_adapters.records import write_overlay
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.frequency_response import estimate_response
from rsea_ros.identification.result import Identification, Overlay, ParameterEstimate, Remark
from rsea_ros.model import outputs
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.model.transfer import frequency_response
from rsea_ros.records.record import Channel, Record
from rsea_ros.report.diagnosis.page import write_diagnosis
from test.report.browser import Browser

DURATION, RATE = 160.0, 280.0


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Give one browser to all pages: to start one takes longer than to draw a page."""
    with closing(Browser(tmp_path_factory.mktemp("browser"))) as made:
        yield made


@pytest.fixture(scope="session")
def shown(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Browser]:
    """Return a function that shows a page in the browser once all of its figures are drawn."""

    def show(html: str, width: int = 1400) -> Browser:
        path = tmp_path_factory.mktemp("shown") / "page.html"
        path.write_text(html, encoding="utf-8")
        browser.errors.clear()
        browser.open(path.as_uri(), width)
        browser.until(f"location.href === '{path.as_uri()}' && document.readyState === 'complete'")
        browser.until("[...document.querySelectorAll('.figure')].every((f) => f.dataset.drawn)")
        return browser

    return show


@pytest.fixture(scope="session")
def identification() -> Identification:
    rig = load_rig("paper_high_impedance")
    u = excitation("chirp", ExcitationSettings(rate=RATE, duration=DURATION))
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
        remarks=(Remark("not_shown", ("spring.damping",)),),
    )


SHORT, FRICTION = 10.0, 3.0
EPOCH = 1_700_000_000_123_456_789


@dataclass(frozen=True)
class Diagnosed:
    """A record of a bench with Coulomb friction, its diagnosis, and the folder of the files."""

    record: Record
    diagnosis: Diagnosis
    out: Path


@pytest.fixture(scope="session")
def diagnosed(tmp_path_factory: pytest.TempPathFactory) -> Diagnosed:
    command = excitation("chirp", ExcitationSettings(rate=RATE, duration=SHORT, seed=3))
    bench = load_rig("paper_high_impedance").with_effects(
        EffectSetting("coulomb_friction", {"torque": FRICTION})
    )
    record = synthesize(bench, Channel(np.arange(len(command)) / RATE, command), seed=5)
    record = replace(record, epoch_ns=EPOCH, source="runs/bench & <friends>")
    tried = ("coulomb_friction", "stribeck_friction", "backlash")
    settings = DiagnosisSettings(without=tuple(n for n in catalogue() if n not in tried))
    diagnosis = diagnose([record], load_rig("paper_high_impedance"), settings=settings)
    out = tmp_path_factory.mktemp("diagnosed") / "new" / "out"
    write_diagnosis(diagnosis, record, out, write_overlay)
    return Diagnosed(record, diagnosis, out)
