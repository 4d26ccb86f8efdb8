"""The edit test: a named cause must survive its removal from the machine.

The machine is edited (play taken out, payload off) and runs again. Of the extended model only that cause is
deleted, nothing is fitted, and the new run is predicted: within the error that the model has on its own
machine, if the name is right. A fit that bent other values to imitate the cause predicts the edited machine
worse than before. Beside it stand the model with the cause, and a dense fit of the same data: the rig with
every value fitted and no cause.
"""

from dataclasses import replace

import numpy as np

from rsea_ros.checks.carried import check_diagnosable, require_motion
from rsea_ros.checks.faults import check
from rsea_ros.diagnosis.result import Diagnosis, Edit
from rsea_ros.errors import ParameterError
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import UNITS, Record


def edited(diagnosis: Diagnosis, record: Record, cause: str) -> Edit:
    """Return the errors of a diagnosis on a run of the edited machine, faulty samples left out.

    cause: that the edit has taken out. Raises ParameterError where the diagnosis has not named it, or the
    run lacks the channel that it was seen in, IdentificationError for a run that cannot be diagnosed.
    """
    names = [c.name for c in diagnosis.causes]
    if cause not in names:
        found = f"one of {', '.join(names)}" if names else "a diagnosis that names one"
        raise ParameterError(f"without cause {cause}: not named by this diagnosis, expected {found}")
    check_diagnosable(record)
    require_motion(record)
    channel = next(c.channel for c in diagnosis.causes if c.name == cause)
    rig = diagnosis.extended_rig  # a condition may say that the run is without the cause: that is asked
    asked = tuple(replace(c, without=c.without - {cause}) for c in rig.conditions)
    extended = replace(rig, conditions=asked)
    without = extended.with_effects(*(e for e in extended.effects if e.name != cause))
    checked = check(record, extended)

    def error(rig: Rig) -> float:
        seen = predict(checked.record, rig).get(channel)
        masked = checked.masked.get(channel, np.zeros(0, bool))
        counts = seen is not None and seen.counts & ~(masked if len(masked) == len(seen.t) else False)
        if seen is None or not np.any(counts):
            raise ParameterError(f"{record.source}: no {channel} to compare, and {cause} was seen in it")
        return float(np.sqrt(np.mean((seen.predicted - seen.measured)[counts] ** 2)))

    return Edit(
        cause, record.source, channel, UNITS[channel], diagnosis.noise_rms[channel], error(extended),
        error(without), error(diagnosis.baseline_rig), diagnosis.extended_residual_rms[channel],
        checked.faults,
    )  # fmt: skip
