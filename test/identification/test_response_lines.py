"""Lines of a response beside scipy's, least squares and periods by hand; channels laid beside the command."""

import numpy as np
import pytest
from scipy import signal

from rsea_ros.errors import IdentificationError
from rsea_ros.identification import local_polynomial as lpm
from rsea_ros.identification.frequency_response import (
    Periods,
    find_periods,
    multisine,
    sampled_lines,
    suits,
    welch,
)
from rsea_ros.identification.local_polynomial import align, clock, usable, widen
from rsea_ros.records.record import Channel, Record

H = 1.0 / 200.0
RNG = np.random.default_rng(5)
NUMERATOR, DENOMINATOR = [0.2, 0.3], [1.0, -0.7, 0.2]


def aligned(u, y, measured=None):
    known = np.ones(len(u), bool) if measured is None else measured
    return lpm.Aligned("ft", 0.0, H, u, y, 0.0, known, np.zeros(1), False, 1.0 / H)


def response_at(hz):
    return signal.freqz(NUMERATOR, DENOMINATOR, 2.0 * np.pi * hz * H)[1]


def noisy(n, scale=0.05):
    u = RNG.standard_normal(n)
    return u, signal.lfilter(NUMERATOR, DENOMINATOR, u) + scale * RNG.standard_normal(n)


def test_welch_is_that_of_scipy_and_its_interval_that_of_many_records() -> None:
    n = 16_000
    u, y = noisy(n)
    found = welch(aligned(u, y))
    length = round(1.0 / (found.frequency[1] - found.frequency[0]) / H)
    assert length == 2 * 1152  # 80 s in 7 parts are 2285.7 samples: the next length without large factors
    options = {"fs": 1.0 / H, "nperseg": length, "detrend": "linear"}
    f, s_uy = signal.csd(u, y, **options)
    s_uu, coherence = signal.welch(u, **options)[1], signal.coherence(u, y, **options)[1]
    np.testing.assert_allclose(found.frequency, f[2:])
    np.testing.assert_allclose(found.response[:-1], (s_uy / s_uu)[2:-1], rtol=2e-2)
    np.testing.assert_allclose(found.coherence[:-1], coherence[2:-1], rtol=1e-2, atol=1e-3)
    assert found.noise is not None  # RMS in a line as wide as 1 / length
    assert np.sqrt(np.mean(found.noise**2)) == pytest.approx(0.05 * np.sqrt(2.0 / length), rel=0.05)
    again = np.array([welch(aligned(*noisy(n))).response for _ in range(12)])
    spread = np.sqrt(np.mean(np.abs(again - response_at(found.frequency)) ** 2))
    assert np.sqrt(np.mean(found.sd**2)) == pytest.approx(spread * 1.2, rel=0.15)  # widened for 11 segments


def test_welch_leaves_out_segments_with_a_gap_and_is_not_for_sweeps_or_short_records() -> None:
    u, y = noisy(16_000)
    measured = np.arange(len(u)) != 8000
    spoiled = np.where(measured, y, 1e6)
    found = welch(aligned(u, spoiled, measured))
    np.testing.assert_allclose(found.response, response_at(found.frequency), atol=0.1)
    assert suits(aligned(u, y)) and not suits(aligned(u, spoiled, measured))  # 11 segments are whole
    assert not suits(aligned(signal.chirp(H * np.arange(16_000), 1.0, 80.0, 99.0), y))
    assert not suits(aligned(u[:5000], y[:5000]))
    assert suits(aligned(u[:6000], y[:6000]))


def test_a_repeating_stretch_is_found_with_its_start_period_and_count() -> None:
    period = RNG.standard_normal(100)
    whole = np.concatenate([np.zeros(70), np.tile(period, 5)[:460], np.zeros(50)])
    found = find_periods(whole)
    assert found is not None and (found.length, found.count) == (100, 4)
    assert found.first in range(70, 131)
    assert find_periods(np.concatenate([np.tile(period, 2), np.zeros(300)])) is None
    assert find_periods(RNG.standard_normal(600)) is None
    assert find_periods(np.zeros(600)) is None


def test_the_lines_of_a_multisine_are_its_response_noise_and_distortion() -> None:
    """Odd lines are excited, but the 9th of each 20: six such lines are too few for odd distortion."""
    n, count = 400, 5
    excited = np.array([k for k in range(1, 120, 2) if k % 20 != 9])
    silent_odd, even = np.arange(9, 119, 20), np.arange(2, 119, 2)
    t = np.arange(n)

    def tones(lines, size, phases):
        return sum(size * np.cos(2.0 * np.pi * k * t / n + p) for k, p in zip(lines, phases, strict=True))

    phases = RNG.uniform(0.0, 6.0, 200)
    u = tones(excited, 1.0, phases[: len(excited)])
    y = tones(excited, 2.0, phases[: len(excited)] + 0.3) + tones(even, 0.05, phases[: len(even)])
    y += tones(silent_odd, 0.04, phases[: len(silent_odd)])
    whole, first = np.tile(y, count), 7
    whole[:n] += 5.0  # has not settled
    noise = 0.3 * RNG.standard_normal((8, n * count))
    pad = np.zeros(first)
    given = [aligned(np.append(pad, np.tile(u, count)), np.append(pad, whole + e)) for e in noise]
    found = [multisine(g, Periods(first, n, count)) for g in given]
    exact = multisine(aligned(given[0].command, np.append(pad, whole)), Periods(first, n, count))
    np.testing.assert_allclose(exact.frequency, excited / (n * H))
    np.testing.assert_allclose(exact.response, 2.0 * np.exp(0.3j), rtol=1e-9)
    np.testing.assert_allclose(exact.coherence, 1.0, rtol=1e-9)
    assert exact.distortion == pytest.approx(np.full(len(excited), 0.05 / np.sqrt(2.0)), rel=1e-6)
    assert exact.noise == pytest.approx(np.zeros(len(excited)), abs=1e-9)
    levels = np.array([f.noise for f in found])
    assert np.sqrt(np.mean(levels**2)) == pytest.approx(0.3 * np.sqrt(2.0 / n), rel=0.05)
    assert np.mean([1.0 - f.coherence for f in found]) == pytest.approx(0.3**2 / n, rel=0.2)
    spread = np.sqrt(np.mean([np.abs(f.response - 2.0 * np.exp(0.3j)) ** 2 for f in found]))
    assert np.sqrt(np.mean([f.sd**2 for f in found])) == pytest.approx(1.37 * spread, rel=0.1)  # 3 degrees
    is_lost = np.arange(first + n * count) == first + 2 * n + 5
    with_gap = multisine(
        aligned(given[0].command, np.where(is_lost, 1e9, given[0].output), ~is_lost), Periods(first, n, count)
    )
    np.testing.assert_allclose(np.abs(with_gap.response), 2.0, rtol=0.1)


def test_odd_and_even_distortion_are_told_apart_and_widen_the_interval() -> None:
    n, t = 800, np.arange(800)
    excited = np.array([k for k in range(1, 300, 2) if k % 8 != 5])
    u = sum(np.cos(2.0 * np.pi * k * t / n + k * k) for k in excited)
    silent = np.setdiff1d(np.arange(1, 300), excited)
    odd, even = silent[silent % 2 == 1], silent[silent % 2 == 0]
    y = 2.0 * u + sum(0.03 * np.cos(2.0 * np.pi * k * t / n + k) for k in odd)
    y = y + sum(0.04 * np.cos(2.0 * np.pi * k * t / n + k) for k in even)
    found = multisine(aligned(np.tile(u, 4), np.tile(y, 4)), Periods(0, n, 4))
    assert found.distortion == pytest.approx(np.full(len(excited), 0.05 / np.sqrt(2.0)), rel=1e-6)
    assert found.sd == pytest.approx(np.full(len(excited), lpm.widen(0.03, 11.0)), rel=1e-6)


def test_the_method_is_that_of_the_command() -> None:
    t = np.arange(4000)
    repeats = np.tile(RNG.standard_normal(500), 8)
    commands = {"multisine": repeats, "local polynomial": signal.chirp(t * H, 0.5, 20.0, 60.0)}
    for method, u in commands.items():
        assert sampled_lines(aligned(u, u)).method == method
    long = RNG.standard_normal(16_000)
    assert sampled_lines(aligned(long, long)).method == "Welch"


def test_local_polynomials_are_least_squares_in_each_band() -> None:
    u, y = noisy(2000)
    known = (np.arange(2000) < 700) | (np.arange(2000) > 720)
    found = lpm.local_polynomial(aligned(u, y, known))
    u, y = (signal.detrend(x[721:]) for x in (u, y))
    n = len(u)
    u, y = np.fft.rfft(u), np.fft.rfft(y)
    centres = np.rint(found.frequency * n * H).astype(int)
    assert centres[0] == 8 and centres[1] == 12
    for centre, g, sd, noise, coherence in zip(
        centres, found.response, found.sd, found.noise, found.coherence, strict=True
    ):
        half = max(8, round(0.03 * centre))
        first = min(max(1, centre - half), len(u) - 2 * half - 1)
        band = np.arange(first, first + 2 * half + 1)
        r = (band - centre) / half
        columns = np.column_stack([r**p * x for x in (u[band], np.ones(len(band))) for p in range(3)])
        solved = np.linalg.lstsq(columns, y[band], rcond=None)[0]
        assert g == pytest.approx(solved[0], rel=1e-5)
        left = np.sum(np.abs(y[band] - columns @ solved) ** 2) / (len(band) - 6)
        assert noise == pytest.approx(np.sqrt(2.0 * left) / n, rel=1e-5)
        variance = left * np.linalg.inv(columns.conj().T @ columns)[0, 0].real
        m = len(band) - 6
        wide = m * (0.05 ** (-1.0 / m) - 1.0) / -np.log(0.05)
        assert sd == pytest.approx(np.sqrt(variance * wide), rel=1e-5)
        power = np.abs(g) ** 2 * np.mean(np.abs(u[band]) ** 2)
        assert coherence == pytest.approx(power / (power + left), rel=1e-5)
    assert np.all(np.diff(centres) == [max(1, max(8, round(0.03 * c)) // 2) for c in centres[:-1]])
    assert centres[-1] < len(u) - 1


def test_a_stretch_is_the_longest_in_which_the_command_changes() -> None:
    u, y = noisy(2000)
    u[:1500] = 3.0
    known = np.arange(2000) != 1500
    with pytest.raises(lpm.AtRestError, match="never changes"):
        lpm.local_polynomial(aligned(np.full(2000, 3.0), y))
    found = lpm.local_polynomial(aligned(u, y, known))
    assert found.frequency[0] == pytest.approx(8.0 / (499 * H))
    few = found.up_to(found.frequency[3])
    assert len(few.frequency) == len(few.response) == len(few.sd) == len(few.coherence) == len(few.noise) == 4


PERIOD, COUNT = 0.004, 600
STAMPS = 0.1 + PERIOD * np.arange(COUNT)
COMMAND = np.random.default_rng(1).standard_normal(COUNT)


def beside(name, t, y):
    return align(Record({"command": Channel(STAMPS, COMMAND), name: Channel(t, y)}), name)


@pytest.mark.parametrize("offset", [0.0, 0.3, -0.2])
def test_a_channel_is_laid_at_its_own_offset(offset):
    t = STAMPS[20:] + offset * PERIOD
    made = beside("ft", t, 2.0 + 3.0 * t)
    assert (made.name, made.held, made.rate) == ("ft", False, pytest.approx(250.0))
    assert made.start == pytest.approx(STAMPS[20]) and made.period == pytest.approx(PERIOD)
    assert made.delay == pytest.approx(offset * PERIOD, abs=1e-9) and made.measured.all()
    np.testing.assert_allclose(made.command, COMMAND[20:], atol=1e-6)
    np.testing.assert_allclose(made.output, 2.0 + 3.0 * t, atol=1e-9)
    np.testing.assert_allclose(made.offsets, offset, atol=1e-6)


def test_a_gap_is_not_measured_and_a_motor_torque_is_of_the_command_before():
    keep = (np.arange(COUNT) < 200) | (np.arange(COUNT) >= 230)
    made = beside("ft", STAMPS[keep], COMMAND[keep])
    assert set(range(200, 230)) <= set(np.flatnonzero(~made.measured)) <= set(range(200, 231))
    torque = beside("motor_torque", STAMPS, np.concatenate([[0.0], COMMAND[:-1]]))
    assert torque.held
    np.testing.assert_allclose(
        torque.output[: len(torque.command)], torque.command[: len(torque.output)], atol=1e-6
    )


def test_a_faster_channel_divides_the_clock_of_the_command():
    t = 0.1 + 0.5 * PERIOD * np.arange(2 * COUNT)
    made = beside("position", t, t)
    assert made.period == pytest.approx(0.5 * PERIOD) and made.rate == pytest.approx(500.0)
    np.testing.assert_allclose(made.command[:20], np.repeat(COMMAND[:10], 2), atol=1e-6)


def test_the_clock_behind_jitter_and_gaps():
    rng = np.random.default_rng(3)
    keep = rng.random(COUNT) > 0.1
    start, period = clock((STAMPS + 2e-4 * rng.standard_normal(COUNT))[keep])
    assert period == pytest.approx(PERIOD, abs=2e-7) and start == pytest.approx(STAMPS[keep][0], abs=1e-4)


def test_what_is_no_number_or_steps_back_is_left_out_and_too_little_refused():
    y, t = np.arange(100.0), np.arange(100.0)
    y[5], t[10], t[20], t[30] = np.nan, np.inf, 3.0, t[29]
    left = usable(Channel(t, y), "bag: ft")
    assert len(left) == 96 and {5.0, 10.0, 20.0, 30.0}.isdisjoint(left.y.tolist())
    usable(Channel(np.arange(32.0), np.zeros(32)), "bag: ft")
    with pytest.raises(IdentificationError, match="bag: ft has 31 usable samples"):
        usable(Channel(np.arange(31.0), np.zeros(31)), "bag: ft")
    with pytest.raises(IdentificationError, match="command and ft overlap for 31 samples"):
        beside("ft", 0.1 + STAMPS[31] - STAMPS[63::-1], COMMAND[:64])


@pytest.mark.parametrize("freedom", [1.0, 5.0, 40.0])
def test_a_doubt_that_is_itself_estimated_is_wider(freedom):
    """|error|^2 over its estimated variance follows F(2, 2 m): (1 + x / m)^-m = 0.05 at its 95 % point x."""
    x = float(widen(np.ones(1), freedom)[0]) ** 2 * -np.log(0.05)
    assert (1.0 + x / freedom) ** -freedom == pytest.approx(0.05)
    assert widen(np.ones(1), 0.2)[0] == widen(np.ones(1), 1.0)[0]
