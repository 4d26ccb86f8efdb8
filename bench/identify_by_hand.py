"""Parameters of `identify` beside a fit that a script writes for one record, and beside the truth.

    .venv/bin/python bench/identify_by_hand.py [--duration 60] [--seeds 5]

The script knows the model (both ends clamped, Eq. 5), the even stamps, the hold and the noise of every
sensor; scipy does the rest. Errors are RMS over seeds, in percent of the true value; seconds are medians
without start-up. `one sigma` is what `identify` states.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.identify import identify
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, FloatArray, Record

RATE, OFF, SETTLE = 280.0, 1.08, 84
"""Hz; true values over those of the rig; samples at the start that no fit uses."""
NAMES = ("rotor.reflected_inertia", "rotor.reflected_damping", "spring.stiffness", "spring.damping")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--duration", type=float, default=60.0, help="s (default %(default)g)")
    parser.add_argument("--seeds", type=int, default=5, help="records of other noise (default %(default)s)")
    args = parser.parse_args()
    rig = load_rig("paper_high_impedance")
    true = np.array([OFF * rig[n] for n in NAMES])
    rows = [_one(rig, true, args.duration, seed) for seed in range(args.seeds)]
    hand, identified, sigma = (
        100.0 * np.sqrt(np.mean([row[k] ** 2 for row in rows], axis=0)) for k in range(3)
    )
    print(f"{args.duration:g} s at {RATE:g} Hz, {args.seeds} records\n{'% of the true value':28}", end="")
    print(f"{'by hand':>10}{'identify':>10}{'one sigma':>11}")
    for i, name in enumerate(NAMES):
        print(f"{name:28}{hand[i]:10.4f}{identified[i]:10.4f}{sigma[i]:11.4f}")
    seconds = [statistics.median(row[k] for row in rows) for k in (3, 4)]
    print(f"{'seconds':28}{seconds[0]:10.2f}{seconds[1]:10.2f}")


def _one(
    rig: Rig, true: FloatArray, duration: float, seed: int
) -> tuple[FloatArray, FloatArray, FloatArray, float, float]:
    """Return relative errors by hand and by identify, the sigma that it states, and the seconds of both."""
    u = excitation("chirp", ExcitationSettings(rate=RATE, duration=duration))
    bench = rig.with_values(dict(zip(NAMES, true, strict=True)))
    record = synthesize(bench, Channel(np.arange(len(u)) / RATE, u), seed=seed)
    start = time.perf_counter()
    hand = by_hand(record, rig)
    middle = time.perf_counter()
    parameters = {p.name: p for p in identify([record], rig).parameters}
    end = time.perf_counter()
    identified = np.array([parameters[n].value for n in NAMES])
    sigma = np.array([0.25 * np.ptp(parameters[n].ci95) for n in NAMES])
    return hand / true - 1.0, identified / true - 1.0, sigma / true, middle - start, end - middle


def by_hand(record: Record, rig: Rig) -> FloatArray:
    """Return inertia, its damping, stiffness and its damping by output error, shape (4,)."""
    u = record["command"].y
    noises = {n: np.hypot(s.noise, s.quantum / np.sqrt(12.0)) for n, s in rig.sensors.items()}
    channels = ("ft", "position", "velocity")
    known = np.log(_values(rig))

    def residual(x: FloatArray) -> FloatArray:
        simulated = _simulate(np.exp(x), u, rig["chassis.inertia"])
        return np.concatenate([(simulated[n] - record[n].y)[SETTLE:] / noises[n] for n in channels])

    return np.asarray(np.exp(least_squares(residual, known, x_scale=0.1).x))


def _values(rig: Rig) -> FloatArray:
    return np.array([rig[n] for n in NAMES])


def _simulate(values: FloatArray, u: FloatArray, chassis: float) -> dict[str, FloatArray]:
    """Return the readings of the sensors at the end of each period of the held command."""
    j_m, b_m, k_s, b_s = values
    below = [j_m + chassis, b_m + b_s, k_s]
    above = {"ft": [b_s, k_s], "position": [1.0], "velocity": [1.0, 0.0]}
    result = {}
    for name, numerator in above.items():
        top, bottom, _ = cont2discrete((numerator, below), 1.0 / RATE, "zoh")
        result[name] = lfilter(np.ravel(top), bottom, np.append(u, u[-1]))[1:]
    return result


if __name__ == "__main__":
    main()
