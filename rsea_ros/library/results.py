"""`rsea.identify` and `rsea.diagnose`: parameters with intervals, and the causes of a misfit, as objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsea_ros.diagnosis.result import Alternative, Cause, Diagnosis, Edit
from rsea_ros.documents import units
from rsea_ros.identification.result import Identification, ParameterEstimate
from rsea_ros.library import notebook
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.outputs.new_files import Destination
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from rsea_ros.diagnosis.settings import DiagnosisSettings


@dataclass(frozen=True)
class Fit:
    """A rig fitted to records. `result` holds every value that the report shows.

    Not to be confused with a diagnosis: a fit moves the rig's values and assumes that its structure is right.
    """

    result: Identification

    @property
    def rig(self) -> Rig:
        """The rig with the identified values and their intervals."""
        return self.result.rig

    @property
    def verdict(self) -> str:
        """`adequate`, `misfit` or `not_identifiable`, as in identification.json."""
        return self.result.verdict

    @property
    def parameters(self) -> dict[str, ParameterEstimate]:
        """Estimates by name, SI, each with `value`, `ci95` and `unit`."""
        return {p.name: p for p in self.result.parameters}

    def summary(self) -> str:
        """Return the verdict, faults of the data, parameters, and what the data cannot determine."""
        from rsea_ros.report.identification import doubt_sentences, terminal_table, verdict_sentence
        from rsea_ros.report.remark_words import fault_lines, remark_sentences

        damage = [f"data: {line}" for line in fault_lines(self.result.faults)]
        beside = [*doubt_sentences(self.result), *remark_sentences(self.result.remarks)]
        table = notebook.plain(terminal_table(self.result))
        return "\n".join([verdict_sentence(self.result), *damage, table, *beside])

    def to_frame(self) -> Any:
        """Return the parameters as a pandas DataFrame, one row each. Raises ParameterError without pandas."""
        return notebook.parameter_frame(self.result.parameters)

    def plot(self, response: int = 0) -> Figure:
        """Return a plotly figure of the measured and fitted frequency response, or of the record."""
        return notebook.fit_figure(self.result, response)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the fitted rig as YAML for `load_rig`. Raises RigError where it cannot be written."""
        save_rig(self.rig, path, force=force)

    def write_report(self, directory: str | Path, *, force: bool = False) -> Path:
        """Write identification.json, model.yaml and report.html; return the report's path.

        force: replace existing results; without it they raise OutputError.
        """
        from rsea_ros.report.identification import write_results

        return write_results(self.result, Destination(Path(directory), force))

    def __repr__(self) -> str:
        """Return rig, fit and parameters in one line."""
        fits = ", ".join(f"{n} {v:.2f} %" for n, v in self.result.fit_percent.items())
        values = ", ".join(
            f"{p.name} {p.value:.5g} {units.plain(p.unit)}"
            for p in self.result.parameters
            if not p.name.startswith("clock.")
        )
        return f"Fit({self.rig.name}: {values}; fit {fits})"

    def _repr_html_(self) -> str:
        from rsea_ros.report.identification import parameter_table

        return parameter_table(self.result.parameters)


def identify(data: Record | Sequence[Record], rig: Rig | str, *, progress: Progress | None = None) -> Fit:
    """Fit the free values of a rig to one record, or to several of the same bench.

    rig: a Rig, a file, or the name of a rig in config/rigs; its values with a spread are free. progress:
    called with the name of a step and the share done, 0 to 1; without it a notebook shows a bar. Raises
    IdentificationError for records from which the rig cannot be identified, RigError for the rig. Method:
    output error, docs/architecture.md.
    Not to be confused with diagnose, which also searches for effects that the rig lacks.
    """
    from rsea_ros.checks.carried import with_check_faults
    from rsea_ros.identification.identify import identify as identify_records

    rig = load_rig(rig)
    records = [
        notebook.without_missing(with_check_faults(r, rig, masks=False)) for r in notebook.records_of(data)
    ]
    with notebook.shown_in_notebook(progress) as say:
        return Fit(identify_records(records, rig, say))


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis of records. `result` holds every value that the report shows; `record` is the first one."""

    result: Diagnosis
    record: Record

    @property
    def rig(self) -> Rig:
        """The rig with its fitted values and with the causes as effects: the extended model."""
        return self.result.extended_rig

    @property
    def verdict(self) -> str:
        """`nothing_wrong`, `explained`, `partly_explained` or `unexplained`."""
        return self.result.verdict

    @property
    def sentence(self) -> str:
        """The verdict in a sentence, as in diagnosis.json."""
        from rsea_ros.report.diagnosis.words import diagnosis_sentence

        return diagnosis_sentence(self.result)

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The causes in the order in which they were accepted.

        Each has `name`, `parameters`, gains, `status` (`confirmed`, `leading` or `one_of`) and `probability`.
        """
        return self.result.causes

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Possible rivals of a cause: `name`, `instead_of`, `parameters`, gains, `probability`."""
        return self.result.alternatives

    def edited(self, record: Record, without_cause: str) -> Edit:
        """Return how well a run of the machine, after a cause was taken out of it, is predicted without it.

        Raises ParameterError for a cause that is not named here.
        """
        from rsea_ros.diagnosis.edit import edited

        return edited(self.result, record, without_cause)

    def summary(self) -> str:
        """Return the verdict and the evidence as plain text."""
        from rsea_ros.report.diagnosis.words import terminal_lines

        return "\n".join(line.plain for line in terminal_lines(self.result))

    def to_frame(self) -> Any:
        """Return the rig's values together with the causes, as a DataFrame.

        Raises ParameterError without pandas.
        """
        return notebook.parameter_frame(self.result.final)

    def plot(self) -> Figure:
        """Return a plotly figure: each channel measured, simulated without the causes, and with them."""
        return notebook.overlay_figure(self.result.before, self.result.after)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the extended model as YAML for `load_rig`. Raises RigError where it cannot be written."""
        save_rig(self.rig, path, force=force)

    def write_report(self, directory: str | Path, *, force: bool = False) -> Path:
        """Write diagnosis.json, model.yaml, overlay.mcap and report.html; return the report's path.

        force: replace existing results; without it they raise OutputError.
        """
        from msg_adapters.records import write_overlay
        from rsea_ros.report.diagnosis.page import write_diagnosis

        return write_diagnosis(self.result, self.record, Destination(Path(directory), force), write_overlay)

    def __repr__(self) -> str:
        """Return the verdict and the causes in one line."""
        causes = ", ".join(f"{cause.name} ({cause.status})" for cause in self.causes) or "none"
        return f"Diagnosed({self.result.rig_name}: {self.verdict}, causes: {causes})"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"


def diagnose(
    data: Record | Sequence[Record],
    rig: Rig | str,
    *,
    holdout: Record | None = None,
    settings: DiagnosisSettings | None = None,
    progress: Progress | None = None,
) -> Diagnosed:
    """Find the causes of the simulation error of a rig in records, and measure the gain of each cause.

    data: one record, or several of the same bench. rig: a Rig, a file, or the name of a rig in config/rigs.
    holdout: a record for testing only; without it, a quarter of their blocks. progress: called with
    the name of a step and the share done, 0 to 1; without it a notebook shows a bar. Raises
    IdentificationError for records that cannot be diagnosed, RigError for the rig. Method: docs/diagnosis.md.
    Not to be confused with identify, which trusts the structure of the rig and fits only its values.
    """
    from rsea_ros.checks.carried import with_check_faults
    from rsea_ros.diagnosis.diagnose import diagnose as diagnose_records

    rig, records = load_rig(rig), notebook.records_of(data)
    carrying = [with_check_faults(record, rig, masks=True) for record in records]
    with notebook.shown_in_notebook(progress) as say:
        result = diagnose_records(carrying, rig, holdout, say, settings=settings)
    return Diagnosed(result, records[0])
