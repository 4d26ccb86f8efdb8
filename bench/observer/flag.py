"""How often noise passes for a torque."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from rsea_ros.model.observer import Observer
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import measure, synthesize
from rsea_ros.model.torque_band import TorqueBand
from rsea_ros.nodes._model_health import CHANGED, EVERY
from rsea_ros.records.record import Channel, FloatArray

CHUNK = 280 * 600


def noise(*, hours: float = 10.0) -> Iterator[str]:
    """Count false alarms on noise alone, and changes beside a small torque in the band."""
    rig = load_rig("paper_high_impedance")
    begin, alarms, rng = time.monotonic(), 0, np.random.default_rng(0)
    observer, band = Observer(rig), TorqueBand(rig)
    chunks = round(hours * 3600.0 * 280.0 / CHUNK)
    for chunk in range(chunks):
        still = np.zeros(CHUNK)
        channels = [measure(rig, n, still, rng) for n in ("position", "motor_torque", "ft")]
        alarms += _changes(observer, band, chunk * CHUNK, *channels)
    spent, simulated = time.monotonic() - begin, chunks * CHUNK / 280.0
    yield (f"noise alone, {simulated / 3600.0:g} h: {alarms} false alarms (required: < 1 an hour), "
           f"{simulated / spent:.0f} times faster than real time")  # fmt: skip
    for amplitude in (0.05, 0.2, 1.0):
        t = np.arange(CHUNK) / 280.0
        record = synthesize(rig, Channel(t, amplitude * np.sin(2.0 * np.pi * 1.0 * t)), seed=1)
        observer, band = Observer(rig), TorqueBand(rig)
        changes = _changes(observer, band, 0, *(record[n].y for n in ("position", "motor_torque", "ft")))
        yield f"1 Hz, {amplitude:g} N·m, ten minutes: {changes} times heard or lost"


def _changes(observer: Observer, band: TorqueBand, first: int, position: FloatArray, torque: FloatArray,
             ft: FloatArray) -> int:  # fmt: skip
    """Return how often a torque was heard or lost after 1 s; measured torque stands for the command.

    The band learns the noise once that has changed, as in the node.
    """
    changes, was, known = 0, False, 0.0
    for k, (q, u, y) in enumerate(zip(position.tolist(), torque.tolist(), ft.tolist(), strict=True), first):
        observer.state(k / 280.0, q, u)
        estimate = observer.ft(k / 280.0, y)
        assert estimate is not None
        heard = band.take(k / 280.0, estimate)
        changes, was = changes + (heard != was and k > 280), heard
        if k % EVERY == 0 and abs(estimate.sigma_distal - known) > CHANGED * known:
            known = estimate.sigma_distal
            band.calibrate(observer.error_model(1.0 / 280.0), 1.0 / 280.0)
    return changes
