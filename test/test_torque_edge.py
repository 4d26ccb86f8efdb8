"""A motor torque at the stamp of a command is of the command that ended there, or of the one that began."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.checks.carried import with_check_faults
from rsea_ros.checks.check import check_record
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.holds import INSIDE, behind_the_edge
from rsea_ros.records.record import Channel, Record
from rsea_ros.records.stamps import repair_stamps

H, COUNT = 1 / 280, 2800
RNG = np.random.default_rng(5)
U = 15.0 * RNG.standard_normal(COUNT)
T = H * np.arange(COUNT)
ENDED = np.concatenate([[0.0], U[:-1]])


def _record(y, t=T, u=U, **others):
    made = {"command": Channel(T, u), "motor_torque": Channel(t, y + 0.05 * RNG.standard_normal(len(y)))}
    return Record({**made, **others})


def test_a_torque_of_the_command_that_begins_moves_behind_its_edge():
    repaired, (fault,) = repair_stamps(_record(0.9 * U + 0.3))
    assert (fault.kind, fault.channel, fault.share) == ("early_torque", "motor_torque", 1.0)
    assert np.allclose(repaired["motor_torque"].t, T + INSIDE * H)
    assert repair_stamps(repaired)[1] == [], "a second pass changes nothing"


@pytest.mark.parametrize(
    "record",
    [
        _record(ENDED),  # the convention
        _record(np.concatenate([[0.0], 0.4 * U[:-1] + 0.6 * ENDED[:-1]])),  # late: a slow current loop
        _record(U, t=T + 0.4 * H),  # between two commands: no doubt
        _record(U[:40], t=T[:40]),  # too few
        _record(RNG.standard_normal(COUNT)),  # of neither
        _record(np.full(COUNT, 3.0), u=np.full(COUNT, 3.0)),  # a command that never changes
        _record(U, reference=Channel(T, U)),  # its commands are those of a simulated loop
    ],
)
def test_any_other_torque_stays(record):
    repaired, faults = behind_the_edge(record)
    assert faults == []
    assert repaired is record


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_no_square_of_a_huge_or_tiny_torque_overflows(size):
    assert not behind_the_edge(_record(size * ENDED, u=size * U))[1]


def test_a_slow_command_decides_it_where_the_noise_lets_it():
    slow = 20.0 * np.sin(2 * np.pi * 1.0 * T)
    assert behind_the_edge(_record(slow, u=slow))[1]
    noisy = _record(slow + RNG.standard_normal(COUNT), u=slow)
    assert not behind_the_edge(noisy)[1]


@pytest.mark.parametrize(("step", "expected"), [(10, INSIDE * H), (0.1, H / 10)])
def test_a_faster_torque_moves_by_no_more_than_its_period(step, expected):
    t = np.arange(0.0, COUNT, step) * H
    held = U[np.minimum(np.floor(t / H + 1e-6).astype(int), COUNT - 1)]
    repaired, faults = behind_the_edge(_record(held, t=t))
    assert len(faults) == 1
    assert repaired["motor_torque"].t[0] == pytest.approx(expected)


@pytest.mark.parametrize(("rate", "late"), [(100.0, 0.0), (280.0, 0.1), (280.0, 0.5), (2000.0, 0.9)])
def test_a_torque_that_is_read_after_its_command_fits_however_late(rate, late):
    rig = load_rig("paper_high_impedance")
    t = np.arange(1000) / rate
    made = synthesize(rig, Channel(t, U[:1000]), seed=1)
    read_after = made.with_channels(motor_torque=_record(U[:1000], t=t + late / rate)["motor_torque"])
    repaired, _ = repair_stamps(read_after)
    assert predict(rig, repaired)["motor_torque"].rms_error < 0.1


def test_a_sound_bench_that_reads_after_its_commands_is_told():
    rig = load_rig("paper_high_impedance")
    made = synthesize(rig, Channel(T, U), seed=1)
    read_after = made.with_channels(motor_torque=_record(U)["motor_torque"])
    assert predict(rig, read_after)["motor_torque"].rms_error > 10.0
    checked = check_record(read_after, rig)
    (told,) = checked.of("early_torque")
    assert (told.light, told.channel) == ("green", "motor_torque")
    assert [f.kind for f in checked.faults] == ["early_torque"]
    assert not check_record(made, rig).of("early_torque")
    assert np.allclose(with_check_faults(read_after, rig, masks=False)["motor_torque"].t, T + INSIDE * H)
    masked = with_check_faults(read_after, rig, masks=True)
    assert np.allclose(masked["motor_torque"].t, T), "its next stage does"
