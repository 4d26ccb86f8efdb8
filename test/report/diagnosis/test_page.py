"""Pages and files of a diagnosis for every verdict."""

import json
from collections.abc import Callable
from dataclasses import replace
from html import escape
from typing import Any

import numpy as np
import pytest

from rsea_ros import simulate
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.result import Cause, CauseParameter, Diagnosis, Experiment
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.errors import RigError
from rsea_ros.library.notebook import overlay_figure
from rsea_ros.library.results import Diagnosed
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import UNITS, Channel, Fault
from rsea_ros.records.statistics import Z95
from rsea_ros.report import words
from rsea_ros.report.diagnosis.page import diagnosis_json, diagnosis_report
from rsea_ros.report.figures import figure as fig
from rsea_ros.report.result_files import DIAGNOSIS

HEADINGS = (
    "explains the misfit",
    "times the noise floor",
    "F/T torque over time",
    "causes were tried, 1 accepted",
    "What these data cannot determine",
    "No fault was found",
)


def test_browser_draws_the_figures_without_an_error(diagnosed, shown) -> None:
    browser = shown((diagnosed.out / "report.html").read_text(encoding="utf-8"))
    document = browser.value("document.documentElement.outerHTML")
    assert browser.errors == []
    assert document.count('data-drawn="yes"') == 3
    for heading in HEADINGS:
        assert heading in document
    assert "T = -torque · sign(ω)" in document
    assert "bench &amp; &lt;friends&gt;" in document and "<friends>" not in document


VERDICTS: dict[str, Callable[[Diagnosis], Diagnosis]] = {
    "nothing_wrong": lambda d: replace(
        d, verdict="nothing_wrong", causes=(), rejected=(), residual_rms=d.extended_residual_rms
    ),
    "unexplained": lambda d: replace(d, verdict="unexplained", causes=(), at_noise_floor=False),
    "partly_explained": lambda d: replace(
        d, verdict="partly_explained", causes=(*d.causes, rival(d.causes[0])), at_noise_floor=False
    ),
    "bare": lambda d: replace(d, spectra=(), before=(), after=(), misfit=(), baseline=(), rejected=()),
}


def rival(cause: Cause) -> Cause:
    return replace(cause, name="backlash", equation="", confusable_with=("hard_stop", "ft_sensor_lag"))


@pytest.mark.parametrize("name", VERDICTS)
def test_every_verdict_makes_a_page(diagnosed, name: str) -> None:
    d = VERDICTS[name](diagnosed.diagnosis)
    d = replace(
        d,
        faults=(Fault("frozen_samples", "ft", 0.05), Fault("nan", "ft", 0.01)),
        next_experiment=Experiment(
            "separates", "<a>", ("b",), 3.0, excitation={"kind": "steps", "amplitude": 12.5, "unit": "N m"}
        ),
    )
    html = diagnosis_report(d)
    head = html[: html.index('id="plotly"')]
    assert "Samples were masked: frozen samples in F/T torque; NaN in F/T torque." in head
    assert "ros2 run rsea_ros excite --ros-args -p kind:=steps -p amplitude:=12.5" in head
    assert "&lt;a&gt;" in head and "<a>" not in head
    assert ("do not distinguish it from hard stop or F/T sensor lag" in head) == (name == "partly_explained")


def test_the_page_of_a_rigid_drive_whose_log_lost_samples_is_written():
    """The search took minutes, then the page died: samples of the log were counted on the grid."""
    rng, rig = np.random.default_rng(3), load_rig("bare_drive")
    run = simulate(rig, np.convolve(2.0 * rng.standard_normal(1200), np.ones(8) / 3.0, "same"), rate=100.0)
    kept = np.sort(rng.choice(1199, 1080, replace=False))
    lossy = run.with_channels(**{n: Channel(c.t[kept], c.y[kept]) for n, c in run.channels.items()})
    tried = ("coulomb_friction", "torque_ripple")
    settings = DiagnosisSettings(without=tuple(n for n in catalogue() if n not in tried))
    diagnosis = diagnose([lossy], rig, settings=settings)
    assert {f.kind for f in diagnosis.faults} == {"dropped_samples"}
    assert diagnosis.before[0].t.shape == diagnosis.masked["motor_torque"].shape
    assert "motor torque" in diagnosis_report(diagnosis)


def strict(text: str) -> Any:
    """Return parsed JSON; NaN and Infinity, which JSON has not, are errors."""

    def refuse(constant: str) -> None:
        raise ValueError(constant)

    return json.loads(text, parse_constant=refuse)


def test_all_files_are_written_and_nothing_else(diagnosed) -> None:
    assert sorted(p.name for p in diagnosed.out.iterdir()) == sorted(DIAGNOSIS)
    assert (diagnosed.out / "report.html").stat().st_size < 8_000_000


def test_json_separates_the_noise_from_the_error_of_the_simulation(diagnosed) -> None:
    """The simulation's 0.25 % dominated nearly every interval, and neither file nor page said so."""
    (cause,) = strict((diagnosed.out / "diagnosis.json").read_text(encoding="utf-8"))["causes"]
    torque = cause["parameters"]["torque"]
    noise = torque["statistical_ci95"][1] - torque["value"]
    assert 0.0 < noise < torque["ci95"][1] - torque["value"]
    assert np.hypot(noise, Z95 * torque["model_sd"]) == pytest.approx(torque["ci95"][1] - torque["value"])
    assert "of which the simulation ±" in (diagnosed.out / "report.html").read_text(encoding="utf-8")


def test_not_a_number_is_written_as_null(diagnosed) -> None:
    unbounded = replace(
        diagnosed.diagnosis.causes[0],
        parameters={"torque": CauseParameter(3.0, "N m", (-np.inf, np.inf))},
        gain_holdout=np.nan,
    )
    odd = replace(
        diagnosed.diagnosis,
        causes=(unbounded,),
        noise_rms={"ft": np.nan},
        faults=(Fault("clock_jump", "ft", np.nan, "3.7 s"),),
        next_experiment=Experiment(
            "separates", "a", ("b",), excitation={"kind": "steps", "amplitude": np.inf}
        ),
    )
    document = strict(json.dumps(diagnosis_json(odd), allow_nan=False))
    assert document["causes"][0]["parameters"]["torque"]["ci95"] == [None, None]
    assert document["causes"][0]["gain"]["holdout"] is None
    assert document["baseline"]["noise_rms"]["ft"] is None
    assert document["data"]["faults"][0] == {
        "kind": "clock_jump", "channel": "ft", "share": None, "detail": "3.7 s"
    }  # fmt: skip
    assert document["next_experiment"]["excitation"] == {"kind": "steps", "amplitude": None}


def test_a_diagnosis_in_a_notebook_has_what_the_files_have(diagnosed, tmp_path) -> None:
    found = Diagnosed(diagnosed.diagnosis, diagnosed.record)
    (cause,) = found.causes
    assert found.rig.effects[0].name == cause.name == "coulomb_friction"
    assert found.rig.effects[0].parameters["torque"] == pytest.approx(3.0, rel=0.05)
    assert found.alternatives == diagnosed.diagnosis.alternatives
    assert found._repr_html_() == f"<pre>{escape(found.summary())}</pre>"
    page = found.write_report(tmp_path / "out")
    names = sorted(path.name for path in diagnosed.out.iterdir())
    assert page == tmp_path / "out" / "report.html" and sorted(p.name for p in page.parent.iterdir()) == names
    found.save(tmp_path / "model.yaml")
    with pytest.raises(RigError, match="exists"):
        found.save(tmp_path / "model.yaml")
    found.save(tmp_path / "model.yaml", force=True)
    assert load_rig(tmp_path / "model.yaml").effects == found.rig.effects
    edit = found.edited(diagnosed.record, "coulomb_friction")
    assert edit.error_before == pytest.approx(edit.noise, rel=0.3) and edit.error_after > 5.0 * edit.noise

    drawn = found.plot()
    before, after = diagnosed.diagnosis.before, diagnosed.diagnosis.after
    assert len(drawn.data) == 3 * len(before) and drawn.layout.xaxis4.title.text == "s"
    for k, (old, new) in enumerate(zip(before, after, strict=True)):
        curves = drawn.data[3 * k : 3 * k + 3]
        assert [c.name for c in curves] == ["measured", "simulated", "with the causes"]
        assert [bool(c.showlegend) for c in curves] == [k == 0] * 3
        assert len({c.line.color for c in curves}) == 3 and curves[0].x is not None
        for curve, values in zip(curves, (old.measured, old.simulated, new.simulated), strict=True):
            np.testing.assert_array_equal(curve.y, values)
    assert drawn.layout.yaxis.title.text.endswith(f", {words.unit(UNITS[before[0].channel])}")
    alone = overlay_figure(before[:1])
    lines = [(c.name, c.line.color) for c in alone.data]
    assert lines == [("measured", fig.MEASURED), ("simulated", fig.AFTER)]
