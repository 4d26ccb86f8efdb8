"""Eq. (10) of the paper, both ways."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.errors import IdentificationError
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.frequency_response import estimate_response
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate, synthesize
from rsea_ros.paper.second_order import SecondOrder, effective_values, fit_second_order
from rsea_ros.records.record import Channel, Record

K_S, C, A1, A0 = 1530.456, 1560.436, 27.267, 1638.783


def record_of_eq_10(noise: float) -> Record:
    """Return the record of a bench that has Eq. (10) for its T_d / T_m: inertia and damping from a0 and a1,
    torque gain c / a0 = 0.952, all damping at the rotor, so that the sensor sees the spring alone."""
    rig = load_rig("paper_high_impedance")
    j_eff = K_S / A0
    values = {"rotor.reflected_inertia": j_eff - rig["chassis.inertia"], "spring.damping": 0.0}
    rig = rig.with_values({**values, "rotor.reflected_damping": A1 * j_eff, "spring.stiffness": K_S})
    u = excitation("chirp", ExcitationSettings())
    t = np.arange(len(u)) / 280.0
    asked = synthesize(rig, Channel(t, u), noise=False)
    weak = simulate(rig, asked.with_channels(command=Channel(t, u * C / A0)))["ft"]
    return asked.with_channels(
        ft=Channel(asked["ft"].t, weak + noise * np.random.default_rng(4).standard_normal(len(u)))
    )


def test_a_record_gives_eq_10() -> None:
    fit = fit_second_order(estimate_response(record_of_eq_10(noise=0.0), "ft"), high=60.0)
    assert (fit.c, fit.a1, fit.a0) == pytest.approx((C, A1, A0), rel=2e-4)
    values = effective_values(K_S, fit.c, fit.a1, fit.a0)
    assert values.inertia == pytest.approx(0.95677, rel=2e-4)
    assert values.damping == pytest.approx(26.088, rel=2e-4)


def test_a_noisy_record_gives_eq_10_within_its_interval() -> None:
    fit = fit_second_order(estimate_response(record_of_eq_10(noise=0.2), "ft"), high=60.0)
    sd = np.sqrt(np.diag(fit.covariance))
    assert np.all(np.abs(np.array([fit.c - C, fit.a1 - A1, fit.a0 - A0])) < 3.0 * sd)
    assert np.all(sd / np.array([C, A1, A0]) < 0.01)


def test_eq_10_has_its_reference_numbers() -> None:
    printed = SecondOrder(C, A1, A0, np.zeros((3, 3)))
    values = effective_values(K_S, C, A1, A0)
    assert values.inertia == pytest.approx(0.95677, abs=5e-6)
    assert values.damping == pytest.approx(26.088, abs=5e-4)
    assert printed.dc_gain == pytest.approx(0.952, abs=5e-4)
    assert printed.natural_frequency == pytest.approx(6.443, abs=5e-4)
    assert printed.damping_ratio == pytest.approx(0.337, abs=5e-4)


def test_a_band_without_lines_is_refused() -> None:
    response = estimate_response(record_of_eq_10(noise=0.0), "ft")
    with pytest.raises(IdentificationError, match="0 lines from 200 to 300 Hz, expected at least 4"):
        fit_second_order(response, low=200.0, high=300.0)
