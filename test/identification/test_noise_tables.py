"""The noise floor of a channel as tables, and of simulated benches; a misfit never raises it."""

import math
import warnings

import numpy as np
import pytest
from benches import bench, record_bench
from runs import RIG
from scipy.signal import lfilter

from rsea_ros import simulate
from rsea_ros.identification.identify import identify
from rsea_ros.identification.noise import least_noise, noise_floor, step_of, top_of_band
from rsea_ros.identification.noise_level import reestimate_noise
from rsea_ros.identification.problem import case_from, simulate_cases
from rsea_ros.identification.unknowns import Clocks
from rsea_ros.model.rig import Sensor
from rsea_ros.records.record import Channel, Record

RATE = 256.0
"""Hz; its period is exact."""


def record(y, command=None, rate=RATE, command_rate=RATE):
    """A record of a channel `ft`, and a command without any relation to it where none is given."""
    span = len(y) / rate
    if command is None:
        command = np.random.default_rng(99).normal(size=max(2, int(span * command_rate)))
    commanded = Channel(np.arange(len(command)) / command_rate, command)
    return Record({"command": commanded, "ft": Channel(np.arange(len(y)) / rate, y)})


def white(size, rms=1.0, seed=0):
    return rms * np.random.default_rng(seed).normal(size=size)


def alternate(size, amplitude=1.0):
    """Values of one size whose signs alternate: all of their power lies at the Nyquist frequency."""
    return amplitude * (-1.0) ** np.arange(size)


SECOND = 4.0 / math.sqrt(6.0)
"""What second differences make of alternating values of size 1."""


@pytest.mark.parametrize(
    ("y", "stated", "floor"),
    [
        (alternate(2), Sensor(), 1e-9),  # too few to say anything: rounding
        (alternate(3), Sensor(), 1e-9 * math.sqrt(8.0) / 3.0),
        (alternate(3), Sensor(0.25), 0.25),
        (alternate(4), Sensor(), SECOND),
        (alternate(62), Sensor(0.25), SECOND),
        (alternate(62), Sensor(2.0), 2.0),  # so few do not contradict the rig
        (alternate(62), Sensor(0.0, 12.0), 6.0),  # half a step of the rig's
        (np.linspace(0.0, 9.0, 62), Sensor(0.25), 0.25),  # a line has no noise
    ],
)
def test_a_short_channel_has_the_noise_of_its_second_differences(y, stated, floor):
    assert noise_floor(record(y), "ft", stated) == pytest.approx(floor, rel=1e-6)


@pytest.mark.parametrize(("size", "short"), [(63, True), (64, False)])
def test_from_64_samples_on_a_channel_has_a_spectrum(size, short):
    floor = noise_floor(record(alternate(size)), "ft", Sensor())
    assert (abs(floor - SECOND) < 0.1) == short


@pytest.mark.parametrize(
    ("stated", "least"),
    [
        (Sensor(), 1e-9),
        (Sensor(2.0), 0.2),  # a tenth: what looks better was filtered
        (Sensor(0.0, 3.0), 1.5),  # half a step
        (Sensor(40.0, 3.0), 4.0),
    ],
)
def test_fine_values_have_a_least_noise(stated, least):
    assert least_noise(white(4000) / np.std(white(4000)), stated) == pytest.approx(least, rel=1e-6)


STEP = math.sqrt(12.0)


@pytest.mark.parametrize(("quantum", "least"), [(0.0, 1.0), (STEP - 1e-9, STEP / 2), (1.0, 1.0), (4.0, 2.0)])
def test_steps_coarser_than_the_rig_says_have_their_own_noise(quantum, least):
    assert least_noise(STEP * np.round(white(4000)), Sensor(0.0, quantum)) == pytest.approx(least)


@pytest.mark.parametrize("rms", [0.1, 1.0, 30.0])
def test_white_noise_has_its_own_level(rms):
    y = white(2**15, rms)
    level, flat = top_of_band(y)
    assert flat and level == pytest.approx(rms, rel=0.03)
    assert noise_floor(record(y), "ft", Sensor()) == pytest.approx(rms, rel=0.03)


@pytest.mark.parametrize(
    ("levels", "level", "flat"),
    [
        ([(0.0, 100.0), (0.60, 1.0)], 1.0, True),  # what lies below the top of the band
        ([(0.86, 1.5)], 1.0, True),  # most of the top of the band
        ([(0.80, 1.7)], None, True),
        ([(0.80, 2.4)], None, False),
        ([(0.0, 2.4), (0.80, 1.0)], None, False),
        ([(0.0, 4.0), (0.70, 1.0)], 1.0, None),
    ],
)
def test_the_noise_is_read_off_the_top_of_the_band(levels, level, flat):
    spectrum = np.ones(2**15 // 2 + 1)
    share = np.linspace(0.0, 1.0, len(spectrum))
    for first, power in levels:
        spectrum[share >= first] = power
    y = np.fft.irfft(np.sqrt(spectrum) * np.fft.rfft(white(2**15)), 2**15)
    rms, is_flat = top_of_band(y)
    assert flat is None or is_flat is flat
    assert level is None or rms == pytest.approx(math.sqrt(level), rel=0.06)


LOG = lfilter([0.25, 0.5, 0.25], [1.0], white(2**14))
"""As of a smoothed log: at 0.8 of the Nyquist frequency 0.095 of its noise is left."""


@pytest.mark.parametrize(
    ("y", "stated", "floor"),
    [
        (white(2**14), Sensor(5.0), 1.0),  # flat: what is measured counts, not what is stated
        (white(2**14), Sensor(20.0), 2.0),  # but no less than a tenth of that
        (LOG, Sensor(5.0), 5.0),  # not flat
        (LOG, Sensor(0.01), 0.095),
    ],
)
def test_the_noise_that_the_rig_states_counts_where_the_spectrum_is_not_flat(y, stated, floor):
    assert noise_floor(record(y), "ft", stated) == pytest.approx(floor, rel=0.1)


@pytest.mark.parametrize(
    ("rate", "stated", "floor"),
    [
        (100.0, Sensor(0.4), 0.4),  # the command's upper half is folded over it
        (100.0, Sensor(0.0, 1.2), 0.6),  # half a step: no model is asked for more
        (100.0, Sensor(0.3, 0.4), math.hypot(0.3, 0.4 / math.sqrt(12.0))),
        (100.0, Sensor(), 1.0),  # nothing is stated: what is measured
        (224.0, Sensor(0.4), 0.4),  # seven eighths of the command's rate
        (240.0, Sensor(0.4), 1.0),  # fifteen sixteenths
        (512.0, Sensor(0.4), 1.0),
    ],
)
def test_a_channel_slower_than_the_command_has_the_noise_that_is_stated(rate, stated, floor):
    assert noise_floor(record(white(2**13), rate=rate), "ft", stated) == pytest.approx(floor, rel=0.05)


@pytest.mark.parametrize("gain", [0.0, 0.5, 20.0])
def test_a_linear_response_to_the_command_is_not_noise(gain):
    command = white(2**15, seed=5)
    response = lfilter([0.0, gain], [1.0, -0.3], command)
    y = response + white(2**15, 0.1, seed=6)
    assert noise_floor(record(y, command), "ft", Sensor()) == pytest.approx(0.1, rel=0.06)


def test_few_segments_do_not_make_noise_smaller():
    """In 15 segments a fourteenth of the noise agrees with any command by chance."""
    floors = [noise_floor(record(white(1024, seed=k)), "ft", Sensor()) for k in range(30)]
    alone = [top_of_band(white(1024, seed=k))[0] for k in range(30)]
    assert 0.98 < np.mean(floors) / np.mean(alone) < 1.05


def test_the_command_in_force_at_an_instant_is_the_last_one_before_it():
    command = Channel(np.arange(4.0), np.array([1.0, 2.0, np.nan, 4.0]))
    at = np.array([-1.0, 0.0, 0.9, 1.0, 2.5, 3.0, 9.0])
    assert np.nan_to_num(command.held(at)).tolist() == [1.0, 1.0, 1.0, 2.0, 0.0, 4.0, 4.0]


GRID = np.resize(np.arange(-3.0, 4.0), 100)


@pytest.mark.parametrize(
    ("values", "step"),
    [
        (0.5 * GRID + 0.2, 0.5),
        (np.where(np.arange(100) == 50, np.nan, GRID), 1.0),
        (np.resize([0.0, 1.0, 2.0], 100), 1.0),  # three values are the fewest
        (np.resize([0.0, 1.0], 100), 0.0),
        (np.resize(np.arange(19.0), 100), 1.0),
        (np.resize(np.arange(20.0), 100), 0.0),  # a fifth of the samples: no steps worth the name
        (np.resize([0.0, 1.0, 2.0, 3.0, 7.0], 100), 1.0),  # some are left out
        (np.resize([0.0, 1.0, 2.0, 3.0009], 100), 1.0),
        (np.resize([0.0, 1.0, 2.0, 3.0012], 100), 0.0),  # off the grid
        (np.full(100, 5.0), 0.0),
    ],
)
def test_the_step_of_coarse_values_is_found(values, step):
    assert step_of(values) == pytest.approx(step)


@pytest.mark.parametrize("missing", ["nothing", "one in a hundred", "some gaps"])
def test_what_moved_while_samples_were_missing_is_no_noise(missing):
    size = 2**14
    t = np.arange(size) / RATE
    lost = {
        "nothing": np.zeros(size, bool),
        "one in a hundred": np.random.default_rng(5).random(size) < 0.01,
        "some gaps": t % 8.0 > 7.8,
    }[missing]
    y = 20.0 * np.sin(2.0 * np.pi * 1.3 * t) + white(size, 0.1, seed=4)
    whole = record(y)
    heard = whole.with_channels(ft=Channel(t[~lost], y[~lost]))
    assert noise_floor(heard, "ft", Sensor()) == pytest.approx(0.1, rel=0.1)


def test_a_jump_at_a_seam_is_no_noise():
    y = np.random.default_rng(1).normal(size=4096)
    joined = y + 1000.0 * (np.arange(4096) >= 2100)
    assert top_of_band(joined, [2100])[0] == pytest.approx(top_of_band(y)[0], rel=0.05)
    assert top_of_band(joined)[0] > 1.2 * top_of_band(y)[0]


RMS = {"ft": 0.1, "position": 4e-5}


def with_coloured_noise(record, memory):
    """Return a record with more noise of first order, `memory` from sample to sample."""
    rng = np.random.default_rng(0)
    added = {}
    for n in RMS:
        white = rng.normal(size=len(record[n]) + 1000)
        noise = RMS[n] * np.sqrt(1.0 - memory**2) * lfilter([1.0], [1.0, -memory], white)[1000:]
        added[n] = Channel(record[n].t.copy(), record[n].y + noise)
    return record.with_channels(**added)


def test_coloured_noise_of_a_clean_bench_is_noise():
    nominal, true = bench("paper_high_impedance", 3)
    result = identify([with_coloured_noise(record_bench(true, 3, 20.0), 0.97)], nominal)
    assert result.verdict == "adequate"
    for n, rms in RMS.items():
        assert 0.8 < result.times_noise[n] < 1.25
        assert result.noise_rms[n] == pytest.approx(rms, rel=0.5)
    assert set(result.coloured) == set(RMS)


@pytest.mark.parametrize("duration", [8.0, 20.0])
def test_white_noise_of_a_short_record_is_not_called_coloured(duration):
    for seed in range(10):
        case = case_from(record_bench(RIG, seed, duration), RIG)
        known = reestimate_noise(case, simulate_cases((case,), RIG, Clocks({}, {}))[0][0])
        assert known.coloured == frozenset(), seed


def test_a_broadband_misfit_is_not_taken_for_coloured_noise():
    nominal, true = bench("paper_high_impedance", 4)
    worn = true.with_effect("coulomb_friction", torque=1.0, creep_velocity=0.02)
    result = identify([with_coloured_noise(record_bench(worn, 4, 20.0), 0.9)], nominal)
    assert result.verdict == "misfit"
    assert result.coloured == ()


def test_states_slower_than_the_commands_have_the_noise_of_their_sensors():
    nominal, true = bench("paper_high_impedance", 6)
    record = record_bench(true, 6, 20.0)
    full = identify([record], nominal)
    thin = np.searchsorted(record["position"].t, np.arange(0.02, 19.9, 0.01))
    names = ("position", "velocity", "motor_torque")
    slow = {n: Channel(record[n].t[thin], record[n].y[thin]) for n in names}
    result = identify([record.with_channels(**slow)], nominal)
    assert result.verdict == "adequate"
    for n in slow:
        assert result.noise_rms[n] == pytest.approx(full.noise_rms[n], rel=0.3), n


@pytest.mark.parametrize("size", [64, 80])
def test_a_short_channel_does_not_show_whether_its_noise_is_flat(size):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rms, flat = top_of_band(np.random.default_rng(0).normal(size=size))
    assert 0.2 < rms < 5.0
    assert not flat


@pytest.mark.parametrize("rest", [2.0, 6.0])
def test_a_recording_that_begins_before_the_first_command_fits_as_well(rest):
    """1.15 and 1.37 times the noise: read off the whole channel, the rest before included."""
    torque = 15.0 * np.random.default_rng(1).standard_normal(1400)
    run = simulate(RIG, np.concatenate([np.zeros(int(280 * rest)), torque]), rate=280.0, seed=3)
    run = run.with_channels(command=run["command"].between(rest - 1e-9, np.inf))
    assert max(identify([run], RIG).times_noise.values()) < 1.08


@pytest.mark.parametrize("delay", [0, 3])
@pytest.mark.parametrize("closed", [True, False])
def test_the_noise_that_a_loop_brings_back_is_its_sensors(closed, delay):
    """Above what the reference asks, the command of a loop holds nothing but the noise of its sensor."""
    rng = np.random.default_rng(4)
    n, h = 8192, 0.002
    slow, noise = np.sin(2.0 * np.pi * 0.7 * h * np.arange(n)), rng.normal(size=n)
    wide = lfilter([0.1], [1.0, -0.9], rng.normal(size=n)) * 20.0
    y, u, x = np.zeros(n), np.zeros(n), 0.0
    for k in range(n):
        y[k] = x + noise[k]
        u[k] = 0.1 * (50.0 * slow[k - delay] - y[k - delay]) if closed else 0.1 * wide[k]
        x = 0.98 * x + 0.05 * u[k]
    assert noise_floor(record(y, u, 1.0 / h, 1.0 / h), "ft", Sensor(1.0)) == pytest.approx(1.0, rel=0.03)
