"""`rsea.identify`: parameters with intervals from records, as an object with summary, table and plot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsea_ros.documents import units
from rsea_ros.identification.result import Identification, ParameterEstimate
from rsea_ros.library.notebook import parameter_frame, plain
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


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
        table = plain(terminal_table(self.result))
        return "\n".join([verdict_sentence(self.result), *damage, table, *beside])

    def to_frame(self) -> Any:
        """Return the parameters as a pandas DataFrame, one row each. Raises ParameterError without pandas."""
        return parameter_frame(self.result.parameters)

    def plot(self, response: int = 0) -> Figure:
        """Return a plotly figure of the measured and fitted frequency response, or of the record."""
        from rsea_ros.library.result_figures import fit_figure

        return fit_figure(self.result, response)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the fitted rig as YAML for `load_rig`. Raises RigError where it cannot be written."""
        save_rig(self.rig, path, force=force)

    def write_report(self, directory: str | Path, *, force: bool = False) -> Path:
        """Write identification.json, model.yaml and report.html; return the report's path.

        force: replace existing results; without it they raise OutputError.
        """
        from rsea_ros.outputs.new_files import Destination
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
    from rsea_ros.library.notebook import records_of, shown_in_notebook, without_missing

    rig = load_rig(rig)
    records = [without_missing(with_check_faults(r, rig, masks=False)) for r in records_of(data)]
    with shown_in_notebook(progress) as say:
        return Fit(identify_records(records, rig, say))
