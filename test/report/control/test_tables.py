"""Signs in the tables of the control page."""

from types import SimpleNamespace

import pytest

from rsea_ros.report.control.tables import compensation_rows, typeset


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("free x 0.5", "free × 0.5"),
        ("torque bandwidth, -3 dB", "torque bandwidth, −3 dB"),
        ("open-loop resonance", "open-loop resonance"),
    ],
)
def test_names_have_proper_signs(name, shown):
    assert typeset(name) == shown


@pytest.mark.parametrize(("gain", "shown"), [(-0.02, "−0.02"), (-0.001, "0.00"), (0.5, "0.50")])
def test_a_gain_has_a_proper_sign_and_zero_has_none(gain, shown):
    effect = SimpleNamespace(name="backlash")
    cell = SimpleNamespace(effect=effect, hz=5.0, without=0.02, with_model=0.02, gain=gain)
    study = SimpleNamespace(rates=[SimpleNamespace(compensations=[cell])])
    ((*_, text),) = compensation_rows(study)
    assert text.endswith(f"gain {shown}")
