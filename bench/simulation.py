"""Time of a simulated record of 160 s at 280 Hz, beside scipy and a plain loop on the same arrays.

Run: python bench/simulation.py [--repeat 15]. Medians; ratios do not depend on the machine, milliseconds do.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lsim

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rsea_ros.model.drive import drive_from
from rsea_ros.model.plant import Plant
from rsea_ros.model.propagator import state_space
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate_drive, synthesize
from rsea_ros.records.record import Channel, Record

DURATION, RATE = 160.0, 280.0
FRICTION = EffectSetting("coulomb_friction", {"torque": 3.0})


def paper_command() -> Channel:
    """Return the paper's chirp, 20 N m from 0.01 to 140 Hz, with noise of 10 N m."""
    t = np.arange(round(DURATION * RATE)) / RATE
    rise = np.log(140.0 / 0.01)
    phase = 2 * np.pi * 0.01 * DURATION / rise * (np.exp(t / DURATION * rise) - 1)
    return Channel(t, 20 * np.sin(phase) + 10 * np.random.default_rng(0).standard_normal(len(t)))


def median_ms(work: Callable[[], object], repeat: int) -> float:
    """Return the median time of some work, ms, after one run that is not counted."""
    work()
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return 1e3 * statistics.median(times)


def scipy_lsim(rig: Rig, record: Record) -> Callable[[], object]:
    """Return the linear rig by scipy.signal.lsim, command held, one step a sample."""
    system, command = state_space(rig), record["command"]
    lti = (system.a, system.b[:, [0]], np.eye(len(system.a)), np.zeros((len(system.a), 1)))
    return lambda: lsim(lti, command.y, np.arange(len(command)) / RATE, interp=False)


def plain_loop(rig: Rig, record: Record) -> Callable[[], object]:
    """Return the linear rig by a loop of NumPy products, on the same steps as the simulation."""
    system, drive = state_space(rig), drive_from(record)
    lti = (system.a, system.b[:, [0]], np.eye(len(system.a)), np.zeros((len(system.a), 1)))
    phi, gamma = cont2discrete(lti, drive.step)[:2]

    def work() -> None:
        x = np.zeros(len(phi))
        for u in drive.command:
            x = phi @ x + gamma[:, 0] * u

    return work


def plant_second(rig: Rig) -> Callable[[], object]:
    """Return one second of the plant, a sample at a time."""
    plant = Plant(rig, RATE)
    return lambda: [plant.step(1.0) for _ in range(int(RATE))]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=15, help="runs of each, of which the median counts")
    repeat = parser.parse_args().repeat
    nominal, moving = load_rig("paper_high_impedance"), load_rig("paper_moving_output")
    frictional = nominal.with_effects(FRICTION)
    record = synthesize(nominal, paper_command())
    drive = drive_from(record)
    lsim_ms = median_ms(scipy_lsim(nominal, record), min(repeat, 5))
    loop_ms = median_ms(plain_loop(nominal, record), min(repeat, 3))
    print(f"{len(record['command'])} samples, {len(drive.command)} steps of {1e6 * drive.step:.0f} µs")
    print(f"{'':34}{'ms':>8}{'/ lsim':>9}{'/ loop':>9}")
    rows: dict[str, Callable[[], object]] = {
        "nominal": lambda: simulate_drive(nominal, drive),
        "nominal, moving output": lambda: simulate_drive(moving, drive),
        "one friction": lambda: simulate_drive(frictional, drive),
        "grid and sampling made anew": lambda: drive_from(record),
    }
    for name, work in rows.items():
        ms = median_ms(work, repeat)
        print(f"{name:34}{ms:8.1f}{ms / lsim_ms:9.4f}{ms / loop_ms:9.4f}")
    print(f"{'scipy.signal.lsim, nominal':34}{lsim_ms:8.1f}")
    print(f"{'NumPy loop on the steps, nominal':34}{loop_ms:8.1f}")
    print(f"{'plant, 280 samples one by one':34}{median_ms(plant_second(nominal), repeat):8.1f}")


if __name__ == "__main__":
    main()
