"""The page of a diagnosis for every verdict; files are complete or absent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from rsea_ros.diagnosis.result import Cause, Diagnosis, Experiment
from rsea_ros.errors import BagError
from rsea_ros.records.record import Fault
from rsea_ros.report.diagnosis.files import write_diagnosis
from rsea_ros.report.diagnosis.page import diagnosis_report

HEADINGS = (
    "explains the misfit",
    "times the noise floor",
    "F/T torque over time",
    "causes were tried, 1 accepted",
    "What these data cannot determine",
    "No fault was found",
)


def test_browser_draws_the_figures_without_an_error(
    diagnosed, opened: Callable[[str, Path], tuple[str, str]], tmp_path: Path
) -> None:
    document, log = opened((diagnosed.out / "report.html").read_text(encoding="utf-8"), tmp_path)
    assert "CONSOLE" not in log
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
    assert "Samples were masked: frozen samples in F/T torque; nan in F/T torque." in head
    assert "ros2 run rsea_ros excite --ros-args -p kind:=steps -p amplitude:=12.5" in head
    assert "&lt;a&gt;" in head and "<a>" not in head
    assert ("do not distinguish it from hard stop or F/T sensor lag" in head) == (name == "partly_explained")


def test_a_failure_leaves_the_old_files_and_nothing_half_written(diagnosed, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("old")

    def no_disk(records: object, path: Path) -> None:
        raise BagError(f"{path}: cannot be written: no space left on device")

    with pytest.raises(BagError, match="no space left"):
        write_diagnosis(diagnosed.diagnosis, diagnosed.record, tmp_path, no_disk)
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text() == "old"
