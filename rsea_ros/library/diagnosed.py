"""`rsea.diagnose`: the causes of the simulation error of a rig, and the extended rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsea_ros.diagnosis.result import Alternative, Cause, Diagnosis, Edit, SmallestChange
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from rsea_ros.diagnosis.settings import DiagnosisSettings


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

    def smallest_changes(self) -> tuple[SmallestChange, ...]:
        """Return the smallest size of each effect beyond the model that the first record would have shown."""
        from rsea_ros.diagnosis.smallest_change import smallest_changes

        return smallest_changes(self.result, [self.record])

    def summary(self) -> str:
        """Return the verdict and the evidence as plain text."""
        from rsea_ros.report.diagnosis.words import terminal_lines

        return "\n".join(line.plain for line in terminal_lines(self.result))

    def to_frame(self) -> Any:
        """Return the rig's values together with the causes, as a DataFrame.

        Raises ParameterError without pandas.
        """
        from rsea_ros.library.notebook import parameter_frame

        return parameter_frame(self.result.final)

    def plot(self) -> Figure:
        """Return a plotly figure: each channel measured, simulated without the causes, and with them."""
        from rsea_ros.library.result_figures import overlay_figure

        return overlay_figure(self.result.before, self.result.after)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the extended model as YAML for `load_rig`. Raises RigError where it cannot be written."""
        save_rig(self.rig, path, force=force)

    def write_report(self, directory: str | Path, *, force: bool = False) -> Path:
        """Write diagnosis.json, model.yaml, overlay.mcap and report.html; return the report's path.

        force: replace existing results; without it they raise OutputError.
        """
        from msg_adapters.records import write_overlay
        from rsea_ros.outputs.new_files import Destination
        from rsea_ros.report.diagnosis.page import write_diagnosis

        return write_diagnosis(self.result, self.record, Destination(Path(directory), force), write_overlay)

    def __repr__(self) -> str:
        """Return the verdict and the causes in one line."""
        causes = ", ".join(f"{cause.name} ({cause.status})" for cause in self.causes) or "none"
        return f"Diagnosed({self.result.rig_name}: {self.verdict}, causes: {causes})"

    def _repr_html_(self) -> str:
        from html import escape

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
    from rsea_ros.checks.carried import check_diagnosable, with_check_faults
    from rsea_ros.diagnosis.diagnose import diagnose as diagnose_records
    from rsea_ros.library.notebook import records_of, shown_in_notebook

    rig, records = load_rig(rig), records_of(data)
    for record in [*records, *([holdout] if holdout is not None else [])]:
        check_diagnosable(record)
    carrying = [with_check_faults(record, rig, masks=True) for record in records]
    with shown_in_notebook(progress) as say:
        result = diagnose_records(carrying, rig, holdout, say, settings=settings)
    return Diagnosed(result, records[0])
