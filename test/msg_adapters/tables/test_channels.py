"""Columns that are no plain channel: raw codes of devices, coarse clocks, readings without a run."""

import numpy as np
import pytest

from msg_adapters.tables import load_map, summary
from msg_adapters.tables.importing import spread_repeats
from msg_adapters.tables.raw_codes import raw_code
from rsea_ros.errors import ImportMapError

MAP = "time: {{column: t, unit: s}}\nchannels: {{{}}}\n"
N = 3000
T = np.arange(N) / 500


def signals(seed):
    """Return what sensors and commands of a joint look like, each about -1 to 1."""
    rng = np.random.default_rng(seed)
    multisine = sum(np.sin(2 * np.pi * f * T + rng.uniform(0, 6)) for f in np.arange(0.25, 12, 0.75)) / 8
    steps = np.repeat(rng.uniform(-1, 1, N // 100), 100)
    pole = np.zeros(N)
    for k in range(1, N):
        pole[k] = pole[k - 1] + 0.05 * (steps[k] - pole[k - 1])
    two_levels = np.where(np.sin(2 * np.pi * 0.7 * T) > 0, 0.8, -0.8)
    return {
        "multisine": multisine + rng.normal(0, 0.01, N),
        "chirp": np.sin(2 * np.pi * (0.2 * T + 1.5 * T**2)) + rng.normal(0, 0.05, N),
        "noise": rng.normal(0, 0.3, N),
        "steps": steps,
        "lagged steps": pole + rng.normal(0, 0.01, N),
        "two levels": two_levels,
        "two noisy levels": two_levels + rng.normal(0, 0.02, N),
        "held": np.repeat(multisine[::10], 10),
        "clipped": np.clip(2 * multisine, -1, 1),
        "dropouts to the lowest": np.where(rng.random(N) < 0.01, -1, 0.6 + 0.05 * multisine),
        "spikes": np.where(rng.random(N) < 0.01, 1.0, 0.1 * multisine),
        "sawtooth": 2 * np.mod(0.8 * T, 1) - 1,
        "random walk": np.cumsum(rng.normal(0, 0.01, N)),
    }


def of_range(y, low, high):
    return np.rint(low + (y - y.min()) / np.ptp(y) * (high - low))


def test_no_ordinary_column_is_taken_for_codes():
    ranges = [(-100, 100), (-30000, 30000), (10, 250), (0, 1023), (0, 4095), (200, 60000), (0, 65535)]
    taken = {
        (name, low, high): code
        for name, y in signals(0).items()
        for low, high in ranges
        if (name, low) != ("sawtooth", 0)
        if (code := raw_code("x", of_range(y, low, high), 1e-3)) is not None
    }
    assert taken == {}


@pytest.mark.parametrize("name", ["multisine", "held"])
@pytest.mark.parametrize(
    ("code", "size", "expression"),
    [
        (lambda i: np.mod(i, 2**8), 60, "int8(x)"),
        (lambda i: np.mod(i, 2**16), 500, "int16(x)"),
        (lambda i: np.mod(i, 2**32), 30000, "int32(x)"),
        (lambda i: np.where(i < 0, 2**10 - i, i), 400, "sign_magnitude(x, 10)"),
        (lambda i: np.where(i < 0, 2**15 - i, i), 900, "sign_magnitude(x, 15)"),
    ],
)
def test_codes_are_recognised_with_the_expression_that_reads_them(name, code, size, expression):
    y = signals(3)[name]
    i = np.rint((y - y.mean()) / np.abs(y - y.mean()).max() * size)
    found = raw_code("x", code(i))
    assert found is not None
    assert f'"{expression}"' in found[1]


@pytest.mark.parametrize(("bits", "gear"), [(10, 1.0), (16, 0.01)])
def test_an_encoder_that_goes_round_is_unwrapped(bits, gear, files):
    turns = np.cumsum(0.01 * np.sin(2 * np.pi * 0.3 * T)) + 0.2
    counts = np.mod(np.rint(turns * 2**bits), 2**bits)
    what, remedy = raw_code("x", counts, gear * 2 * np.pi / 2**bits)
    assert what == f"encoder counts that begin anew at {2**bits}"
    rows = "".join(f"{t:.3f},{c:.0f}\n" for t, c in zip(T, counts, strict=True))
    expression, unit = remedy.replace("`", "").split(", unit")
    record = files(MAP.format(f"position: {{{expression}, unit{unit}}}"), f"t,x\n{rows}")
    expected = gear * 2 * np.pi * turns
    np.testing.assert_allclose(np.ptp(record["position"].y), np.ptp(expected), rtol=2e-2)
    assert np.abs(np.diff(record["position"].y)).max() < 0.1 * gear


ROWS = "t,i,u\n" + "".join(f"{k / 10},{(k % 21 - 10) % 65536},{k % 7}.5\n" for k in range(100))


def test_a_channel_of_codes_is_left_out_and_reported(files):
    both = "motor_torque: {column: i, unit: N m}, command: {column: u, unit: N m}"
    record = files(MAP.format(both), ROWS)
    assert list(record.channels) == ["command"]
    (fault,) = record.faults
    assert (fault.kind, fault.channel) == ("raw_codes", "motor_torque")
    assert fault.detail == (
        "left out: i holds signed 16 bit numbers read as unsigned, 0 to 65535; "
        'in the map: `expression: "int16(i)"`'
    )


@pytest.mark.parametrize("expression", ["int16(i)", "uint16(i)"])
def test_an_expression_that_reads_the_codes_is_taken_at_its_word(expression, files):
    record = files(MAP.format(f"motor_torque: {{expression: {expression}, unit: N m}}"), ROWS)
    assert record["motor_torque"].y.min() == (-10 if expression == "int16(i)" else 0)


@pytest.mark.parametrize(
    ("channel", "message"),
    [
        ("motor_torque: {expression: 2 * i, unit: N m}", "no channel is left: motor_torque: left out: i"),
        ("position: {column: k, unit: rad}", "whole rad alone: counts of an encoder.*scale:` 2 pi over"),
        ("position: {column: k, unit: rev, sign: -1}", "whole turns alone: counts of an encoder"),
    ],
)
def test_an_import_of_codes_alone_is_refused(channel, message, files):
    text = "t,k,i\n" + "".join(f"{k / 10},{3 * k},{(k % 21 - 10) % 65536}\n" for k in range(200))
    with pytest.raises(ImportMapError, match=message):
        files(MAP.format(channel), text)


def _true_times(rng, count, rate, wander, stalls):
    """Return sampling times whose rate wanders, with pauses."""
    phase = np.cumsum(rng.normal(size=count)) / np.sqrt(count)
    steps = (1 + wander * np.tanh(phase)) / rate
    steps[rng.integers(0, count, stalls)] += rng.uniform(0.02, 0.2, stalls)
    return np.cumsum(steps)


@pytest.mark.parametrize(("tick", "wander", "stalls"), [(1 / 64, 0.25, 0), (0.01, 0.0, 6), (0.1, 0.25, 6)])
def test_stamps_come_within_a_sample_of_the_truth(tick, wander, stalls):
    rng = np.random.default_rng(8)
    truth = _true_times(rng, 20_000, 400.0, wander, stalls)
    stamps, report = spread_repeats(np.floor(truth / tick) * tick)
    error = stamps - truth
    error -= np.median(error)
    period = (1 + wander) / 400
    assert np.all(np.diff(stamps) > 0)
    near_stall = np.zeros(truth.size, bool)
    for at in np.flatnonzero(np.diff(truth) > 0.01):
        near_stall |= np.abs(truth - truth[at]) < 0.2 + 2 * tick
    assert np.max(np.abs(error[~near_stall])) < 2 * period
    assert np.std(error[~near_stall]) < 0.5 * period
    assert np.max(np.abs(error)) < tick + 2 * period
    assert "stamps repeat" in report


@pytest.mark.parametrize("tick", [1 / 64, 0.01, 0.1])
def test_even_samples_are_dated_far_better_than_their_ticks(tick):
    truth = 3.0 + np.arange(20_000) / 280.0
    stamps, report = spread_repeats(np.round(truth / tick) * tick)
    assert np.max(np.abs(np.diff(stamps) - 1.0 / 280.0)) < 1e-6
    assert np.max(np.abs(stamps - truth)) < 0.02 * tick
    assert "fit, 280 Hz" in report


def test_a_good_clock_stays_as_it_is():
    t = np.cumsum(np.random.default_rng(1).uniform(0.5e-3, 1.5e-3, 500))
    stamps, report = spread_repeats(t)
    assert stamps is t
    assert report == ""


def test_one_repeated_stamp_moves_nothing_else():
    t = np.arange(100) * 1e-3
    t[40] = t[39]
    stamps, report = spread_repeats(t)
    others = np.arange(100) != 40
    assert np.allclose(stamps[others], t[others], rtol=0, atol=1e-12)
    assert t[39] < stamps[40] < t[41]
    assert "1 of 100 stamps repeat" in report


ANGLES = np.r_[np.arange(-20, 21), np.arange(20, -21, -1)] / 1000
RUN = "t,i,q\n" + "".join(f"{k / 100},{np.sin(k / 9):.4f},{np.sin(k / 9) / 50:.6f}\n" for k in range(99))
STATIC = """time: set_points
channels:
  deflection: {column: q, unit: rad}
  command: {column: u, unit: N m}
  ft: {column: f, unit: N m}
"""
MEASURED = """time: {column: t, unit: s}
channels:
  motor_torque: {column: i, unit: N m}
  position: {column: q, unit: rad}
"""


def calibration():
    rng = np.random.default_rng(0)
    rows = (f"{q},{200 * q / 6.8},{198 * q + rng.normal(0, 0.02)}" for q in ANGLES)
    return "q,u,f\n" + "\n".join(rows) + "\n"


def test_a_static_calibration_gives_the_stiffness_with_its_interval(files):
    record = files(STATIC, calibration())
    line = next(note for note in record.notes if note.startswith("ft over deflection"))
    slope, half = line.split(": ")[1].split(" N·m/rad")[0].split(" ± ")
    assert abs(float(slope) - 198) < float(half) < 0.5
    assert any(note.startswith("ft over command: 6.7") for note in record.notes)
    assert set(record.channels) == {"deflection", "ft"}  # no verb may take a second a reading for a run


def test_what_can_be_done_without_a_run_is_told(files, tmp_path):
    for text, rows, said in (
        (STATIC, calibration(), "need the record of a motion"),
        (MEASURED, RUN, "no command: `check` compares the channels"),
    ):
        record = files(text, rows)
        assert said in " ".join(summary(record, load_map(tmp_path / "map.yaml")))


def test_a_map_without_a_time_is_told_what_there_is(files):
    with pytest.raises(ImportMapError, match=r"expected .* or `set_points` for readings"):
        files(STATIC.partition("\n")[2], calibration())
