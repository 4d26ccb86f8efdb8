"""The questions of the library, `rsea.identify`, `rsea.diagnose` and the others; their answers as objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsea_ros.design.motor_gear_units import PAPERS, unit_named
from rsea_ros.diagnosis.result import Alternative, Cause, Diagnosis, Edit, SmallestChange
from rsea_ros.documents import units
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import ParameterError, check_kind, check_number, check_rate
from rsea_ros.identification.result import Identification, ParameterEstimate
from rsea_ros.library import notebook
from rsea_ros.library.notebook import records_of, shown_in_notebook
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.outputs.files import Destination
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from rsea_ros.design.spring_design import SpringDesign
    from rsea_ros.diagnosis.settings import DiagnosisSettings
    from rsea_ros.experiment.advice import Advice
    from rsea_ros.laws.law import LawResult

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


def save(thing: Rig | Fit | Diagnosed | Record, path: str | Path, *, force: bool = False) -> None:
    """Write a rig, or that of a fit or a diagnosis, as YAML for `load_rig`; a record as a bag for `read_bag`.

    force: over what is there. Raises RigError or BagError where it cannot be written, ParameterError for
    another suffix. Not to be confused with write_report, which writes every result and its page.
    """
    check_kind("save", thing, (Rig, Fit, Diagnosed, Record), "a Rig, a fit, a diagnosis or a Record")
    check_kind("path", path, (str, Path), "the name of a file")
    suffixes = (".mcap", ".db3", "") if isinstance(thing, Record) else (".yaml", ".yml", "")
    if Path(path).suffix not in suffixes:
        raise ParameterError(f"path {quote(str(path))}, expected {' or '.join(suffixes[:2])}")
    if isinstance(thing, Record):
        from msg_adapters.records import write_record

        write_record(thing, path, force=force)
    else:
        save_rig(thing if isinstance(thing, Rig) else thing.rig, path, force=force)


def law(data: Record | Sequence[Record], rig: Rig | str, *, progress: Progress | None = None) -> LawResult:
    """Find laws of few terms for the residual that a rig leaves in records and no effect explains.

    data, rig, progress: as `diagnose` takes them; rig: best that of a diagnosis. The result has no `laws`
    where nothing helps on held-out blocks; each has its parameters, and the text of an effect file.
    Raises IdentificationError for records that are too short or lack a channel. Method: docs/laws.md.
    """
    from rsea_ros.checks.carried import with_check_faults
    from rsea_ros.laws.learn import learn

    rig = load_rig(rig)
    records = [with_check_faults(record, rig, masks=True) for record in records_of(data)]
    with shown_in_notebook(progress) as tell:
        return learn(records, rig, progress=tell)


def experiment(
    models: Sequence[Rig | str],
    limits: Mapping[str, float],
    *,
    rate: float,
    longest: float = 10.0,
    progress: Progress | None = None,
) -> Advice:
    """Return the run that separates possible causes best within limits, or the proof that none does.

    models: two or more rigs or files, each with its cause as the last effect. limits: by name, SI, either
    way, torque among them: `{"torque": 20.0, "velocity": 1.0}`. rate: commands a second, Hz. longest: s.
    The run is `proposal.command` of the result, N m, shape (n,); `proposal` is None where no run helps.
    Raises ParameterError for limits or models that cannot be compared. Method: docs/experiment.md.
    """
    from rsea_ros.experiment.advice import advise
    from rsea_ros.experiment.proposal import DesignRequest
    from rsea_ros.experiment.run_shape import limits_of
    from rsea_ros.experiment.stored_models import hypotheses_from, model_of
    from rsea_ros.identification.solver import worker_pools

    check_kind("models", models, Sequence, "two or more rigs or files")
    check_kind("limits", limits, Mapping, 'limits by name, SI: {"torque": 20.0}')
    for name, limit in limits.items():
        check_number(f"limit {name}", limit)
    check_number("longest", longest)
    check_rate(rate)
    asked = DesignRequest(limits_of(limits), rate, min(0.5, longest), longest)
    hypotheses = hypotheses_from([model_of(load_rig(model)) for model in models])
    with worker_pools() as pools, shown_in_notebook(progress) as tell:
        return advise(hypotheses, asked, {}, pools.run, tell)


def design(*, stiffness: float | None = None, unit: str = PAPERS, **demands: float) -> SpringDesign:
    """Return the spring of least stiffness that meets all demands, by the paper's method; or test one.

    stiffness: N m/rad, to test instead. unit: motor and gear, by name in the catalogue. demands: torque N m,
    bandwidth Hz, inertia kg m^2, mass kg, diameter m, separation m, spring_radius m, deflection rad,
    tolerance_db dB, tolerance_deg deg; those not stated are the paper's knee.
    Raises ParameterError for a demand that no spring of this kind meets. Method: docs/derivation.md.
    """
    from rsea_ros.design.mechanism import Requirement
    from rsea_ros.design.spring_design import least_stiffness, spring_design

    known = vars(Requirement())
    for name in demands:
        if name not in known:
            raise ParameterError(
                f"demand {quote(name)}{did_you_mean(name, known)}, expected one of {', '.join(known)}"
            )
    for name, value in (demands if stiffness is None else {**demands, "stiffness": stiffness}).items():
        check_number(name, value)
    check_kind("unit", unit, str, "the name of a motor and gear")
    requirement, motor = Requirement(**demands), unit_named(unit, None)
    if stiffness is None:
        stiffness = least_stiffness(requirement, motor)
    return spring_design(requirement, motor, stiffness)
