"""Commands published only when they change are held, as the bench held them; repeated samples are counted."""

from dataclasses import replace

import numpy as np
import pytest

import rsea_ros as rsea
from msg_adapters import read_record, write_record
from rsea_ros.checks.check import check_record
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.holds import ends_of_lines, repeats_of, with_held_commands
from rsea_ros.records.record import Channel, Record
from rsea_ros.records.stamps import repair_stamps

RIG = "paper_high_impedance"
RATE = 280.0


def steps(count: int, seconds: float, seed: int = 4) -> np.ndarray:
    """Commands of a loop: levels that each last about so long."""
    rng = np.random.default_rng(seed)
    lasts = rng.uniform(0.5, 1.5, count) * seconds * RATE
    return np.repeat(rng.uniform(-15.0, 15.0, count), np.rint(lasts).astype(int))


def on_change(record):
    """The record of a publisher that sends a command only when it differs from the last."""
    command = record["command"]
    new = np.concatenate([[True], np.diff(command.y) != 0.0])
    return record.with_channels(command=Channel(command.t[new], command.y[new]))


@pytest.fixture(scope="module")
def run():
    return rsea.simulate(load_rig(RIG).with_values({"spring.stiffness": 1500.0}), steps(12, 1.0), RATE)


def test_held_commands_are_those_that_the_loop_had(run):
    filled, _ = with_held_commands(on_change(run))
    assert filled["command"].t == pytest.approx(run["command"].t, abs=1e-9)
    assert np.array_equal(filled["command"].y, run["command"].y)
    assert "12 messages" in filled.notes[-1]


def test_identify_from_a_few_messages_gives_what_all_of_them_give(run, tmp_path):
    """A dozen commands were refused: command has 12 usable samples, expected at least 32."""
    write_record(on_change(run), tmp_path / "bag")
    fit, whole = (rsea.identify(record, RIG) for record in (read_record(tmp_path / "bag"), run))
    assert fit.verdict == "adequate"
    for name, parameter in fit.parameters.items():
        assert parameter.value == pytest.approx(whole.parameters[name].value, rel=1e-6)
    low, high = fit.parameters["spring.stiffness"].ci95
    assert low < 1500.0 < high


def test_a_check_calls_them_neither_slow_nor_lost(run):
    findings = check_record(on_change(run), load_rig(RIG)).findings
    bad = [(f.kind, f.channel) for f in findings if f.channel == "command" and f.light != "green"]
    assert not bad
    assert any("12 messages" in f.detail for f in findings if f.kind == "rate")


@pytest.mark.parametrize("every", [1, 6, 20])
def test_commands_of_a_slow_loop_are_left_as_they_are(run, every):
    """A loop at 14 Hz and more sends samples of a signal, and each counts as lost where it is missing."""
    noise = np.random.default_rng(1).standard_normal(len(run["command"]))
    slow = run.with_channels(command=Channel(run["command"].t[::every], noise[::every]))
    assert with_held_commands(slow)[0] is slow


def test_the_last_command_is_held_to_the_end_of_the_sensors(run):
    filled, faults = repair_stamps(on_change(run))
    assert filled["command"].t[-1] == pytest.approx(run["command"].t[-1], abs=0.01)
    assert not [fault for fault in faults if fault.channel == "command"]


def test_commands_without_a_sensor_are_left_as_they_are(run):
    alone = rsea.Record({"command": on_change(run)["command"]})
    assert with_held_commands(alone)[0] is alone


def mixed(seed: int = 6) -> np.ndarray:
    """Commands of a loop: noise, then a level for some seconds, and again."""
    rng = np.random.default_rng(seed)
    parts = [(10.0 * rng.standard_normal(900), np.full(840, level)) for level in (3.0, -2.0, 0.0)]
    return np.concatenate([part for pair in parts for part in pair] + [10.0 * rng.standard_normal(900)])


@pytest.fixture(scope="module")
def paused():
    """The record of a publisher at the rate of its loop, which is silent while its command stays."""
    whole = rsea.simulate(load_rig(RIG), mixed(), RATE)
    return whole, on_change(whole)


def test_a_pause_of_the_commands_alone_is_no_loss(paused):
    """2517 of 6000 samples were called dropped, from a publisher that had nothing new to say."""
    whole, silent = paused
    repaired, faults = repair_stamps(silent)
    assert not [fault for fault in faults if fault.channel == "command"]
    assert repaired["command"].t == pytest.approx(whole["command"].t, abs=1e-6)
    assert np.array_equal(repaired["command"].y, whole["command"].y)
    assert any("3 pauses of the commands alone, the longest 3 s" in note for note in repaired.notes)


def test_commands_that_stop_with_the_sensors_are_lost(run):
    on = {n: (c.t < 4.0) | (c.t > 5.0) for n, c in run.channels.items()}
    kept = {n: Channel(c.t[on[n]], c.y[on[n]]) for n, c in run.channels.items()}
    _, faults = repair_stamps(run.with_channels(**kept))
    (lost,) = [f.size for f in faults if (f.kind, f.channel) == ("dropped_samples", "command")]
    assert lost == pytest.approx(RATE, abs=2)


def test_commands_lost_one_by_one_are_lost_beside_a_pause(paused):
    _, silent = paused
    keep = np.arange(len(silent["command"])) % 50 != 7
    t, y = silent["command"].t[keep], silent["command"].y[keep]
    _, faults = repair_stamps(silent.with_channels(command=Channel(t, y)))
    (lost,) = [f.size for f in faults if (f.kind, f.channel) == ("dropped_samples", "command")]
    assert lost == pytest.approx(np.count_nonzero(~keep), abs=2)


def test_a_log_with_repeats_is_left_as_it_is(run):
    command = run["command"]
    rare = run.with_channels(command=Channel(command.t[::100], np.repeat([1.0, -1.0], len(command))[::200]))
    assert with_held_commands(rare)[0] is rare


def test_targets_of_a_position_loop_are_held_too(run):
    targets = run.with_channels(reference=Channel(np.arange(6.0), np.arange(6.0)))
    assert len(with_held_commands(targets)[0]["reference"]) > 5 * RATE


VALUES = np.random.default_rng(2).standard_normal(400)


@pytest.mark.parametrize("times", [1, 3, 7])
@pytest.mark.parametrize("size", [1e-300, 1.0, 1e300])
def test_repeats_are_counted_at_any_size(times, size):
    assert repeats_of(size * np.repeat(VALUES, times)) == times


@pytest.mark.parametrize("odd", [np.nan, np.inf])
def test_a_channel_with_a_value_that_is_no_number_is_left_to_the_checks(odd):
    """inf - inf was a warning on the terminal of `predict`."""
    assert repeats_of(np.repeat(np.where(np.arange(400) > 200, odd, VALUES), 7)) == 1


def resampled(factor, noise=0.02, uneven=0.0):
    """Return readings at 100 Hz, and what a logger makes of them on a grid `factor` times as fine."""
    rng = np.random.default_rng(1801)
    t = 0.01 * np.arange(1200) + rng.uniform(0.0, uneven, 1200)
    y = np.sin(7.0 * t) + noise * rng.standard_normal(1200)
    grid = np.arange(round(100 * factor * t[-1])) / (100 * factor)
    return Channel(t, y), Channel(grid, np.interp(grid, t, y))


@pytest.mark.parametrize("factor", [2, 3, 5, 10])
def test_a_resampled_log_gives_its_readings_back(factor):
    """Noise a tenth of the sensor's was told, and a flawless machine was 31 and 58 times that off."""
    read, log = resampled(factor)
    repaired, (fault,) = repair_stamps(Record({"ft": log}))
    assert (fault.kind, fault.channel, fault.unit) == ("interpolated", "ft", "Hz")
    assert fault.size == pytest.approx(100.0, rel=0.02) and f"lines over {factor}" in fault.detail
    kept = repaired["ft"]
    assert np.allclose(np.interp(kept.t, read.t, read.y), kept.y, atol=1e-9)
    assert np.mean(np.isin(np.round(kept.t, 9), np.round(read.t, 9))) > 0.98
    assert len(kept) == pytest.approx(1200, rel=0.02)
    assert repair_stamps(replace(repaired, faults=(fault,)))[1] == []


def test_an_uneven_log_on_a_grid_gives_back_what_is_next_to_its_readings():
    read, log = resampled(10, uneven=0.006)
    repaired, faults = repair_stamps(Record({"ft": log}))
    assert "interpolated" in {f.kind for f in faults}
    nearest = np.abs(repaired["ft"].t[:, None] - read.t).min(axis=1)
    assert np.mean(nearest < 1.01e-3) > 0.95 and len(repaired["ft"]) == pytest.approx(1200, rel=0.06)


RAMP = np.abs(np.arange(8000) * 1e-3 % 4.0 - 2.0)


@pytest.mark.parametrize(
    "values",
    [
        np.sin(0.01 * np.arange(4000)),  # a simulation without noise
        RAMP,
        np.clip(RAMP, 0.5, 1.5),
        np.round(RAMP / 1.1e-3) * 1.1e-3,  # an encoder at a constant speed
        np.round(3.0 * RAMP / 1e-3) * 1e-3,
        np.cumsum(np.sign(np.sin(1e-3 * np.arange(8000)))) * 1e-3,
        np.repeat(np.random.default_rng(0).standard_normal(800), 10),  # held
        np.random.default_rng(0).standard_normal(4000),
        resampled(1)[1].y,
        np.full(4000, 2.0),
        np.where(np.arange(4000) < 2500, 0.0, np.sin(0.01 * np.arange(4000))),
    ],
)
def test_no_other_log_has_lines_between_readings(values):
    assert ends_of_lines(values) is None
