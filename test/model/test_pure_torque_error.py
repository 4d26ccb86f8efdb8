"""The flag measures |T_p - T_d| against |T_d|: against a dense sum, over kinds of torque, and its edge."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rsea_ros.errors import ParameterError, RigError
from rsea_ros.model.observer import TorqueEstimate
from rsea_ros.model.pure_torque_error import BEYOND, NOTHING, PURE, ErrorFlag, ErrorSettings, edge_of
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import end_to_end, flat_band
from rsea_ros.paper.formulas import PROTOTYPE_TRAINS

RATE = 1000.0
PLATFORM, KNEE = load_rig("paper_high_impedance"), load_rig("prototype_knee")
SETTINGS = ErrorSettings()


def ends(rig, lines):
    """T_d and T_p of a spectrum of T_d around a circle of RATE, N m."""
    function, count = end_to_end(rig), 2 * (len(lines) - 1)
    hz = np.fft.rfftfreq(count, 1.0 / RATE)
    inverse = np.array([1.0 / function(2j * np.pi * f) for f in hz])
    return np.fft.irfft(lines, count), np.fft.irfft(lines * inverse, count)


def noise(seconds, top, seed=0, rms=3.0):
    """Spectrum of noise that is flat to a frequency."""
    count = round(seconds * RATE)
    lines = np.fft.rfft(np.random.default_rng(seed).standard_normal(count))
    lines[np.fft.rfftfreq(count, 1.0 / RATE) > top] = 0.0
    return lines * rms / np.fft.irfft(lines, count).std()


def tones(seconds, *hz):
    """Spectrum of sines of 4 N m."""
    count = round(seconds * RATE)
    lines = np.zeros(count // 2 + 1, complex)
    for k, f in enumerate(hz):
        lines[round(f * seconds)] = 2.0 * count * np.exp(1j * k)
    return lines


def verdicts_of(flag, distal, proximal, sigma=0.007):
    """Verdicts and shares by sample."""
    rows = []
    for k, (d, p) in enumerate(zip(distal.tolist(), proximal.tolist(), strict=True)):
        verdict = flag.take(k / RATE, TorqueEstimate(d, p, 0.0, sigma, sigma, sigma))
        rows.append((verdict, flag.share))
    return np.array(rows).T


def true_share(distal, proximal, window):
    """RMS(T_p - T_d) / RMS(T_d) over the last seconds, summed anew at every sample."""
    n = round(window * RATE)
    error = np.square(proximal - distal)
    cuts = [slice(max(0, k + 1 - n), k + 1) for k in range(len(distal))]
    return np.sqrt([error[c].sum() / max(np.square(distal[c]).sum(), 1e-12) for c in cuts])


CASES = {
    "sine in the band": tones(4.0, 20.0),
    "sine beyond": tones(4.0, 62.0),
    "two tones, one beyond": tones(4.0, 10.0, 75.0),
    **{f"flat to {top:g} Hz": noise(6.0, top) for top in (20.0, 80.0, 100.0)},
}


@pytest.mark.parametrize("name", CASES)
def test_the_verdict_is_that_of_the_true_error(name):
    """Asked: right in 95 % of the time outside 20 % of the tolerance, at most one change a second."""
    distal, proximal = ends(PLATFORM, CASES[name])
    verdicts, shares = verdicts_of(ErrorFlag(PLATFORM), distal, proximal)
    true = true_share(distal, proximal, SETTINGS.window)
    settled = np.arange(len(true)) > RATE
    np.testing.assert_allclose(shares[settled], true[settled], rtol=1e-9)
    clear = settled & (np.abs(true / SETTINGS.tolerance - 1.0) > 0.2)
    right = verdicts == np.where(true <= SETTINGS.tolerance, PURE, BEYOND)
    assert right[clear].mean() >= 0.95 if clear.any() else True
    assert np.count_nonzero(np.diff(verdicts[settled])) <= settled.sum() / RATE


@pytest.mark.parametrize("rig", [PLATFORM, KNEE], ids=lambda rig: rig.name)
@pytest.mark.parametrize(("before", "after"), [(0.3, 1.3), (1.5, 0.5)])
def test_the_latency_is_at_most_the_window(rig, before, after):
    edge = ErrorFlag(rig).edge.hz
    first, second = (ends(rig, tones(2.0, round(2.0 * part * edge) / 2.0)) for part in (before, after))
    verdicts, _ = verdicts_of(
        ErrorFlag(rig), np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])
    )
    late = 2000 + round(SETTINGS.window * RATE) + 1
    assert np.all(verdicts[1000:2000] == (PURE if before < 1.0 else BEYOND))
    assert np.all(verdicts[late:] == (PURE if after < 1.0 else BEYOND))


def test_the_edge_is_where_a_dense_search_first_leaves_the_tolerance():
    hz = np.arange(0.01, 100.0, 0.01)
    for rig in (PLATFORM, KNEE):
        function = end_to_end(rig)
        error = np.array([abs(1.0 / function(2j * np.pi * f) - 1.0) for f in hz])
        assert edge_of(rig, 0.3).hz == pytest.approx(hz[np.argmax(error > 0.3)], abs=0.011)


def test_the_interval_of_the_edge_follows_from_damping_rotor_and_train():
    edge = edge_of(PLATFORM, 0.3)
    hard, soft = (edge_of(PLATFORM.with_values({"spring.damping": b}), 0.3).hz for b in (1.4, 6.5))
    assert edge.low < hard < edge.hz < soft < edge.high
    both = edge_of(KNEE, 0.3)
    alone, other = (edge_of(replace(KNEE, train=t, other_trains=()), 0.3) for t in PROTOTYPE_TRAINS)
    assert both.low == min(alone.low, other.low)
    assert both.high == max(alone.high, other.high)
    exact = {n: replace(q, spread=0.0) for n, q in KNEE.quantities.items()}
    certain = replace(KNEE, other_trains=(), quantities=exact)
    assert len(set(edge_of(certain, 0.3))) == 1


@pytest.mark.parametrize(
    ("damping", "error_hz", "band_hz"),
    [(1.0, 44.8, 44.7), (3.0, 47.8, 57.0), (6.0, 59.0, 89.3)],
)
def test_the_edges_move_with_the_damping(damping, error_hz, band_hz):
    """The error's edge solves J w^2 = 0.3 |K_s + i b_s w|; the other, of ±3 dB and 30°, is 45 to 89 Hz."""
    rig = PLATFORM.with_values({"spring.damping": damping})
    inertia, w = 0.0040 + 0.953 / 502, 2.0 * math.pi * edge_of(rig, 0.3).hz
    assert inertia * w**2 == pytest.approx(0.3 * abs(1530.456 + 1j * damping * w), rel=1e-9)
    assert edge_of(rig, 0.3).hz == pytest.approx(error_hz, abs=0.06)
    assert flat_band(end_to_end(rig), 3.0, 30.0) == pytest.approx(band_hz, abs=0.06)


def test_the_interval_has_no_end_where_the_spin_may_cancel_the_chassis():
    """J_sc + n J_r is zero for a J_m of 1.05 times the rig's: T_d is T_p there, at every frequency."""
    cancelled = KNEE.with_values({"chassis.inertia": 1.05 * 1.2 / 160})
    assert edge_of(replace(cancelled, other_trains=()), 0.3).high > 1e4


def test_without_torque_the_flag_says_so_and_restarts():
    flag, quiet = ErrorFlag(PLATFORM), np.random.default_rng(1).normal(0.0, 0.007, (4000, 2))
    verdicts, shares = verdicts_of(flag, quiet[:, 0], quiet[:, 1])
    assert np.all(verdicts == NOTHING)
    assert np.isnan(shares).all()
    distal, proximal = ends(PLATFORM, tones(1.0, 20.0))
    verdicts, _ = verdicts_of(
        ErrorFlag(PLATFORM), np.concatenate([distal, 0.0 * distal]), np.concatenate([proximal, 0.0 * distal])
    )
    assert verdicts[900] == PURE
    assert verdicts[-1] == NOTHING


def test_a_torque_too_small_to_judge_keeps_the_verdict():
    flag = ErrorFlag(PLATFORM)
    for k in range(3000):
        size = 5.0 if k < 1000 else 0.01
        d = size * math.sin(2.0 * math.pi * 2.0 * k / RATE)
        verdict = flag.take(k / RATE, TorqueEstimate(d, d, 0.0, 0.007, 0.007, 0.007), heard=k < 2000)
        assert verdict == (PURE if 100 < k < 2200 else verdict)
    assert verdict == NOTHING
    assert math.isnan(flag.share)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("heard", [False, True])
def test_a_threshold_that_is_no_number_is_not_pure(bad, heard):
    """A sigma of the proximal torque that overflows held the flag up for good."""
    distal, proximal = (values.tolist() for values in ends(PLATFORM, tones(1.0, 20.0)))
    flag = ErrorFlag(PLATFORM)
    for k, (d, p) in enumerate(zip(distal, proximal, strict=True)):
        sigma = bad if k == 800 else 0.007
        verdict = flag.take(k / RATE, TorqueEstimate(d, p, 0.0, 0.007, sigma, 0.007), heard=heard)
        assert verdict == (NOTHING if k == 800 else PURE if k > 200 else verdict)
    assert flag.verdict == "pure", "it comes back with the numbers"


@pytest.mark.parametrize("change", [{"tolerance": 0.0}, {"window": math.nan}, {"hysteresis": 0.6}])
def test_impossible_settings_are_refused(change):
    with pytest.raises(ParameterError, match=f"{next(iter(change))} = "):
        ErrorSettings(**change)


def test_without_a_spring_there_is_one_torque():
    with pytest.raises(RigError, match=r"spring.rigid = True"):
        ErrorFlag(load_rig("bare_drive"))
