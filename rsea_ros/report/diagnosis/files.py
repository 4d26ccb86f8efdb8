"""The files of a diagnosis, all or none: diagnosis.json, overlay.mcap, the extended model, the page."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rsea_ros.diagnosis.result import Alternative, Cause, Diagnosis, Misfit
from rsea_ros.identification.result import Overlay
from rsea_ros.model.rig_file import rig_text
from rsea_ros.outputs.new_files import Destination, NewFiles
from rsea_ros.records.record import Channel, Record
from rsea_ros.report import result_files as outputs
from rsea_ros.report.diagnosis import words as say
from rsea_ros.report.diagnosis.page import diagnosis_report
from rsea_ros.report.identification.words import parameters_json
from rsea_ros.report.remark_words import remark_sentences
from rsea_ros.report.result_files import pick
from rsea_ros.report.rig import rig_json

SCHEMA = 1
MEASURED, BEFORE, AFTER = "/rsea", "/rsea/simulated_before", "/rsea/simulated_after"
"""Namespaces of the three sets of topics in overlay.mcap."""
OverlayWriter = Callable[[Mapping[str, Record], Path], None]
"""Writes records by namespace into one bag file: msg_adapters.records.write_overlay."""


def write_diagnosis(
    diagnosis: Diagnosis, record: Record, out: Destination | str | Path, write: OverlayWriter,
    provenance: outputs.Provenance | None = None,
) -> Path:  # fmt: skip
    """Write diagnosis.json, model.yaml, overlay.mcap and report.html, and return the report's path.

    record: the first one diagnosed, as it was read. Raises OutputError for a name that is taken, OSError or
    BagError where something cannot be written.
    """
    with NewFiles(out) as new:
        new.write(outputs.DIAGNOSIS_JSON, outputs.json_text(diagnosis_json(diagnosis), provenance))
        new.write(outputs.MODEL, rig_text(diagnosis.extended_rig))
        write(overlay_records(diagnosis, record), new.stage(outputs.OVERLAY))
        return new.write(outputs.REPORT, diagnosis_report(diagnosis, provenance))


def overlay_records(diagnosis: Diagnosis, record: Record) -> Mapping[str, Record]:
    """Return by namespace the record as it was read, and both simulations of its channels.

    record: the first one diagnosed. Simulations have the stamps that the diagnosis used, which are the
    record's own but for repaired faults of the clock.
    """

    def simulated(overlays: Sequence[Overlay]) -> Record:
        return Record(
            {o.channel: Channel(o.t, o.simulated) for o in overlays}, record.source, record.epoch_ns
        )

    return {MEASURED: record, BEFORE: simulated(diagnosis.before), AFTER: simulated(diagnosis.after)}


def diagnosis_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return the contents of diagnosis.json; infinite numbers and NaN are null."""
    d, numbers = diagnosis, {s.name: outputs.strict(s.value) for s in diagnosis.settings.numbers()}
    following = d.next_experiment
    return {
        "schema": SCHEMA,
        "rig": d.rig_name,
        **rig_json(d.rig_choice, d.remarks),
        **pick(d, "verdict channel"),
        "sentence": say.diagnosis_sentence(d),
        "data": {**pick(d, "bags=sources duration_s=duration rate_hz=rate"),
                 "faults": [outputs.fault_json(f) for f in d.faults]},
        "baseline": {"parameters": parameters_json(d.baseline),
                     **pick(d, "residual_rms noise_rms fit_percent")},
        "misfit": _misfits(d.misfit),
        "causes": [_cause(c) for c in d.causes],
        "alternatives": [_alternative(a) for a in d.alternatives],
        "rejected": [
            {**pick(r, "name gain_holdout"), "why": say.rejection(r), "reason": r.reason,
             "rival": r.rival or None, **pick(r, "fitted=is_fitted probability")}
            for r in d.rejected
        ],
        "extended": {
            "parameters": parameters_json(d.final),
            **pick(d, "residual_rms=extended_residual_rms fit_percent=extended_fit_percent at_noise_floor"),
            "misfit": _misfits(d.remaining),
        },
        "next_experiment": following and {"why": say.next_run(following), **pick(following, "excitation")},
        "statements": list(remark_sentences(d.remarks)),
        "settings": {**pick(d.settings, "max_causes without"), **numbers},
        "noise_numbers": {name: v for name, v in numbers.items() if name.startswith("noise.")},
    }  # fmt: skip


def _misfits(misfits: Sequence[Misfit]) -> list[dict[str, Any]]:
    return [pick(m, "what from=low to=high unit times_noise channel") for m in misfits]


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        **pick(cause, "name status probability channel"),
        "parameters": _sizes(cause),
        "gain": pick(cause, "train=gain_train holdout=gain_holdout holdout_ci95=gain_holdout_ci95"),
        "evidence": say.evidence(cause),
        **pick(cause, "equation confusable_with"),
    }


def _alternative(a: Alternative) -> dict[str, Any]:
    gain = pick(a, "holdout=gain_holdout holdout_ci95=gain_holdout_ci95")
    return {**pick(a, "name instead_of probability channel"), "parameters": _sizes(a), "gain": gain}


def _sizes(cause: Cause | Alternative) -> dict[str, Any]:
    return {n: pick(p, "value unit ci95 statistical_ci95 model_sd") for n, p in cause.parameters.items()}
