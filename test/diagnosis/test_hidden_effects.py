"""An effect is drawn from a seed and hidden in the second bench; the diagnosis is not told which.

The bench shares no code with the model (test/independent), so that an error in the simulator cannot be in
both. `conceal` is the only place that knows.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
import pytest
from independent.bench import drawn_bench, record_run
from independent.hidden import MAIN_PARAMETER, hide
from independent.severities import SIZES, drawn_parameters

from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Record

SECONDS = {36: 8.0, 38: 8.0}
"""Duration of the records of each seed; bench/diagnosis.py plays every effect in every severity."""


@dataclass(frozen=True)
class Concealed:
    """What the diagnosis may see, and what it may not."""

    record: Record
    fresh: Record
    effect: str
    size: float


@functools.cache
def conceal(seed: int) -> Concealed:
    """Draw a bench, an effect, its severity and the excitation."""
    rng = np.random.default_rng(seed)
    effect = str(rng.choice(list(SIZES)))
    parameters = drawn_parameters(effect, str(rng.choice(("medium", "strong"))), rng)
    excitation = str(rng.choice(("chirp_noise", "multisine")))
    bench = hide(drawn_bench(rng), effect, parameters)
    record, fresh = (record_run(bench, 1000 * seed + k, excitation, SECONDS[seed]) for k in (1, 2))
    return Concealed(record, fresh, effect, parameters[MAIN_PARAMETER[effect]])


@pytest.mark.parametrize("seed", SECONDS)
def test_the_hidden_effect_is_found_with_its_size_and_its_gain(seed):
    concealed = conceal(seed)
    diagnosis = diagnose([concealed.record], load_rig("paper_high_impedance"))
    assert [cause.name for cause in diagnosis.causes] == [concealed.effect]

    cause = diagnosis.causes[0]
    estimate = cause.parameters[MAIN_PARAMETER[concealed.effect]]
    assert estimate.value == pytest.approx(concealed.size, rel=0.1)

    before, after = (
        predict(rig, concealed.fresh)[cause.channel].rms_error
        for rig in (diagnosis.baseline_rig, diagnosis.extended_rig)
    )
    assert 1.0 - after / before == pytest.approx(cause.gain_holdout, abs=0.05)


def test_an_effect_outside_the_catalogue_gets_no_name():
    """The hidden effect and all that look like it are not tried: then nothing is named."""
    concealed = conceal(36)
    claims = effect_named(concealed.effect).claims
    alike = {n for n, e in catalogue().items() if concealed.effect in e.claims.confusable_with}
    settings = DiagnosisSettings(without=(concealed.effect, *alike, *claims.confusable_with))
    diagnosis = diagnose([concealed.record], load_rig("paper_high_impedance"), settings=settings)
    assert (diagnosis.verdict, diagnosis.causes) == ("unexplained", ())
