"""Parts of a diagnosis as HTML: tables, every channel before and after, and the next run."""

from __future__ import annotations

from html import escape

from rsea_ros.diagnosis.result import Diagnosis, Experiment
from rsea_ros.records.record import UNITS
from rsea_ros.report import words
from rsea_ros.report.diagnosis import numbers as num
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.sentences import next_run
from rsea_ros.report.page.html import code, paragraph, section
from rsea_ros.report.page.html_table import table_of_rows

_EXCITE = ("kind", "amplitude", "noise", "low", "high", "period", "duration", "rate", "seed")
"""Settings that are parameters of the node excite."""


def channel_section(diagnosis: Diagnosis) -> str:
    """Return every channel with its held-out residual before and after."""
    changed = ("#Residual before", "#after", "#Times the noise before", "#after")
    head = (
        "Channel",
        "#Noise, RMS",
        *(changed if diagnosis.causes else ("#Residual, RMS", "#Times the noise")),
    )
    reached = "All channels are" if diagnosis.at_noise_floor else "Not all channels are"
    rows = [_channel(diagnosis, name) for name in diagnosis.residual_rms]
    caption = "On held-out data."
    return section(f"{reached} at their noise", table_of_rows(head, rows), caption=caption)


def _channel(d: Diagnosis, name: str) -> str:
    unit, stages = UNITS[name], 2 if d.causes else 1
    rms = [words.quantity(v[name], unit) for v in (d.residual_rms, d.extended_residual_rms)]
    ratios = [words.number(v, 3) for v in num.times_noise(d, name)]
    values = [words.quantity(d.noise_rms[name], unit), *rms[:stages], *ratios[:stages]]
    cells = "".join(f"<td class='number'>{escape(v)}</td>" for v in values)
    return f"<tr><td>{escape(words.sentence(words.channel(name)))}</td>{cells}</tr>"


def experiment_section(experiment: Experiment) -> str:
    """Return the purpose of the next run, its settings, and the command that plays it."""
    settings = words.sentence(say.excitation(experiment.excitation))
    run = paragraph(f"{settings}.") if settings else ""
    title = "The run that would decide" if experiment.excitation else "What would decide"
    return section(title, paragraph(say.prose(next_run(experiment))), run, _command(experiment))


def _command(experiment: Experiment) -> str:
    given = experiment.excitation
    settings = {k: given[k] for k in _EXCITE if k in given}
    if "kind" not in settings or given.get("unit") != UNITS["command"]:
        return ""  # excite plays torques, not positions
    options = " ".join(f"-p {k}:={v}" for k, v in settings.items())
    return f"<p class='under'>{code(f'ros2 run rsea_ros excite --ros-args {options}')}</p>"
