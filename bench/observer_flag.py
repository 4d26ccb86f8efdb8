"""The pure-torque flag: how soon it is right, and how often noise raises it."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np

from rsea_ros.model.observer import ErrorModel, Observer, TorqueEstimate
from rsea_ros.model.pure_torque import PureTorque
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import measure, synthesize
from rsea_ros.records.record import Channel, FloatArray

PARTS = (0.1, 0.5, 0.9, 0.95, 1.05, 1.1, 1.5, 2.0)
CHUNK = 280 * 600


def settle(rig: Rig, rate: float) -> ErrorModel:
    """Return the estimates of an observer from noise alone, once it has run for a second."""
    observer = Observer(rig)
    for k in range(round(rate)):
        observer.state(k / rate, 0.0, 0.0)
        observer.ft(k / rate, 0.0)
    return observer.error_model(1.0 / rate)


def sines(args: argparse.Namespace) -> Iterator[str]:
    """Print the time to the right verdict over what is allowed: worst of 16 phases, 3 beginnings."""
    yield "worst time to the right verdict over what is allowed (3 periods or 50 ms), sine of 5 N·m"
    yield f"{'f / edge':34}" + "".join(f"{part:7.2f}" for part in PARTS)
    for name in ("paper_high_impedance", "prototype_knee"):
        for rate in (280.0, 1000.0):
            rig = load_rig(name)
            error = settle(rig, rate)
            cells = [_worst(rig, rate, error, part) for part in PARTS]
            yield f"{name + f', {rate:g} Hz':34}" + "".join(f"{cell:7.2f}" for cell in cells)


def _worst(rig: Rig, rate: float, error: ErrorModel, part: float) -> float:
    worst = 0.0
    for phase in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
        for before in (0.0, 0.3, 1.6):
            flag = PureTorque(rig)
            flag.calibrate(error, 1.0 / rate)
            f = part * flag.edge
            allowed, start = max(3.0 / f, 0.05), 0.3
            t = np.arange(round((start + allowed + 0.3) * rate)) / rate
            first = 5.0 * np.sin(2.0 * np.pi * before * flag.edge * t + 2.0 * phase) * (before > 0.0)
            torque = np.where(t < start, first, 5.0 * np.sin(2.0 * np.pi * f * (t - start) + phase))
            right = "pure" if part < 1.0 else "beyond"
            wrong = [
                s - start
                for s, y in zip(t, torque, strict=True)
                if flag.take(s, TorqueEstimate(y, y, 0.0, error.sigma, 0.0, 0.0)) != right and s >= start
            ]
            worst = max(worst, max(wrong, default=0.0) / allowed)
    return worst


def noise(args: argparse.Namespace) -> Iterator[str]:
    """Count changes of the flag on noise alone, and beside a small torque in the band."""
    rig = load_rig("paper_high_impedance")
    begin, alarms, rng = time.monotonic(), 0, np.random.default_rng(0)
    observer, flag = Observer(rig), PureTorque(rig)
    chunks = round(args.hours * 3600.0 * 280.0 / CHUNK)
    for chunk in range(chunks):
        still = np.zeros(CHUNK)
        channels = [measure(rig, n, still, rng) for n in ("position", "motor_torque", "ft")]
        alarms += _changes(observer, flag, chunk * CHUNK, *channels)
    spent, simulated = time.monotonic() - begin, chunks * CHUNK / 280.0
    yield (f"noise alone, {simulated / 3600.0:g} h: {alarms} changes of the flag (required: < 1 an hour), "
           f"{simulated / spent:.0f} times faster than real time")  # fmt: skip
    for amplitude in (0.05, 0.2, 1.0):
        t = np.arange(CHUNK) / 280.0
        record = synthesize(rig, Channel(t, amplitude * np.sin(2.0 * np.pi * 1.0 * t)), seed=1)
        observer, flag = Observer(rig), PureTorque(rig)
        changes = _changes(observer, flag, 0, *(record[n].y for n in ("position", "motor_torque", "ft")))
        yield f"1 Hz, {amplitude:g} N·m, ten minutes: {changes} changes of the flag, then {flag.verdict}"


def _changes(observer: Observer, flag: PureTorque, first: int, position: FloatArray, torque: FloatArray,
             ft: FloatArray) -> int:  # fmt: skip
    """Return how often the flag changed after the first second; measured torque stands for the command."""
    changes = 0
    for k, (q, u, y) in enumerate(zip(position.tolist(), torque.tolist(), ft.tolist(), strict=True), first):
        observer.state(k / 280.0, q, u)
        estimate = observer.ft(k / 280.0, y)
        was = flag.verdict == "pure"
        assert estimate is not None
        changes += (flag.take(k / 280.0, estimate) == "pure") != was and k > 280
        if k == 140:
            flag.calibrate(observer.error_model(1.0 / 280.0), 1.0 / 280.0)
    return changes
