"""`rsea.law`, `rsea.experiment`, `rsea.design`: the questions beside a fit and a diagnosis; `rsea.save`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rsea_ros.design.motor_gear_units import PAPERS, unit_named
from rsea_ros.documents.wording import did_you_mean, quote
from rsea_ros.errors import ParameterError, check_kind, check_number, check_rate
from rsea_ros.library.notebook import records_of, shown_in_notebook
from rsea_ros.library.results import Diagnosed, Fit
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.progress import Progress
from rsea_ros.records.record import Record

if TYPE_CHECKING:
    from rsea_ros.design.spring_design import SpringDesign
    from rsea_ros.experiment.advice import Advice
    from rsea_ros.laws.law import LawResult


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
