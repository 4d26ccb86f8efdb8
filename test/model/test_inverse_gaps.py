"""Gaps in the record of a drive without a spring: the filter must not smear them over what was measured."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import rsea_ros as rsea
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model import inverse
from rsea_ros.records.record import Channel, Record


@functools.cache
def whole():
    settings = ExcitationSettings(duration=20.0, amplitude=10.0, noise=2.0)
    return rsea.simulate("pendulum", excitation("chirp", settings), 280.0, seed=3)


def without(seconds, *names):
    """Return the run without the samples of some channels from 8 s on."""
    left_out = {n: (c.t >= 8.0) & (c.t < 8.0 + seconds) for n in names for c in [whole()[n]]}
    return whole().with_channels(
        **{n: Channel(whole()[n].t[~out], whole()[n].y[~out]) for n, out in left_out.items()}
    )


ALL = ("command", "position", "velocity", "motor_torque")


@pytest.mark.parametrize("names", [ALL, ("position",), ("motor_torque",)])
@pytest.mark.parametrize("seconds", [0.5, 5.0])
def test_a_gap_changes_no_result(seconds, names):
    """Half a second without rows took the prediction from 96 to 78 % and made a sound fit a misfit."""
    record, truth = without(seconds, *names), rsea.load_rig("pendulum")
    predicted = rsea.predict("pendulum", record)["motor_torque"]
    sound = rsea.predict("pendulum", whole())["motor_torque"]
    assert predicted.rms_error == pytest.approx(sound.rms_error, rel=0.15)
    fit = rsea.identify(record, "pendulum")
    assert fit.verdict == "adequate"
    assert "dropped_samples" in {fault.kind for fault in fit.result.faults}
    for name, estimate in fit.parameters.items():
        low, high = estimate.ci95
        assert low < truth[name] < high


@pytest.mark.parametrize("off", [0.0, 4e-10, -4e-10])
def test_stamps_rounded_to_nanoseconds_change_no_prediction(off):
    """The same run as a bag and as arrays: an RMS of 0.21 and 0.91 N m."""
    rounded = {
        n: Channel(np.round(c.t, 9) + off * (n == "command"), c.y) for n, c in whole().channels.items()
    }
    predicted = rsea.predict("pendulum", whole().with_channels(**rounded))["motor_torque"]
    sound = rsea.predict("pendulum", whole())["motor_torque"]
    assert predicted.rms_error == pytest.approx(sound.rms_error, rel=1e-3)
    assert predicted.fit_percent > 95.0


def test_nothing_of_a_gap_is_compared():
    predicted = rsea.predict("pendulum", without(5.0, *ALL))["motor_torque"]
    inside = (predicted.t > 7.8) & (predicted.t < 13.2)
    assert inside.any() and not predicted.counts[inside].any()
    np.testing.assert_array_equal(predicted.counts[~inside][400:600], True)


def test_a_record_of_short_pieces_alone_is_compared_as_a_whole():
    """Every second half of a second is missing: no piece is long enough for the filter to settle."""
    holes = np.floor(2.0 * whole()["position"].t) % 2 == 1
    pieces = whole().with_channels(
        **{n: Channel(c.t[~holes[: len(c)]], c.y[~holes[: len(c)]]) for n, c in whole().channels.items()}
    )
    assert np.isfinite(rsea.predict("pendulum", pieces)["motor_torque"].rms_error)


@pytest.mark.parametrize("names", [("command",), ("command", "motor_torque")])
@pytest.mark.parametrize("off", [0.0, 4e-10, -4e-10])
def test_a_held_torque_is_neither_early_nor_late(names, off):
    """Every edge took the value behind it: torques 0.2 ms early, and 1 of 24 intervals of J_m with the truth.

    The torque is a step at 1 s: its integral from 0.5 to 1.5 s is 0.5 N m s, more where it is early.
    """
    t = np.arange(0.0, 2.0, 0.25)
    step = (t >= 1.0).astype(float)
    channels = {"command": Channel(t + off, step), "motor_torque": Channel(t + 0.25, step)}
    record = Record({n: channels[n] for n in names})
    fine = np.arange(0.5, 1.51, 0.05)
    torque = inverse._torque_at(record, fine)
    assert np.trapezoid(torque, fine) == pytest.approx(0.5, abs=1e-6)
