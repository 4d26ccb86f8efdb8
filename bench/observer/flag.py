"""The pure-torque flag: its verdict against the true error over signals."""

from collections.abc import Iterator, Mapping

import numpy as np

from bench.observer.truth import true_run
from bench.results import Row
from rsea_ros.model import outputs
from rsea_ros.model.observer import Observer, TorqueEstimate, observe
from rsea_ros.model.pure_torque_error import BEYOND, PURE, ErrorFlag, ErrorSettings
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.transfer import end_to_end, frequency_response
from rsea_ros.records.record import FloatArray

BAND = 0.2
"""Part of the tolerance, either way, within which the flag may say either."""
SECONDS, SETTLE = 10.0, 1.5
"""s, of each signal, and before it counts."""
RIGS = (("paper_high_impedance", 1000.0), ("paper_high_impedance", 280.0), ("prototype_knee", 1000.0))
OTHERS = {
    "b_s = 1.5": {"spring.damping": 1.5},
    "b_s = 6": {"spring.damping": 6.0},
    "J_m - 25 %": {"rotor.reflected_inertia": 0.715},
    "J_m + 25 %": {"rotor.reflected_inertia": 1.191},
}
"""Possible benches, while the model is that of Table 2."""


def flag() -> Iterator[Row | str]:
    """Print the verdict over signals, then latencies, then benches that differ from the model."""
    settings = ErrorSettings()
    for name, rate in RIGS:
        rig = load_rig(name)
        edge = ErrorFlag(rig, settings).edge
        over = f"{edge.low:.1f} to {edge.high:.1f} Hz over b_s and J_m"
        yield f"\n{name}, {rate:g} Hz, RMS over {settings.window:g} s: |T_p - T_d| <= " \
            f"{settings.tolerance:g} |T_d| for sines up to {edge.hz:.1f} Hz ({over})"
        for what, torque in signals(rate, edge.hz, np.random.default_rng(3)).items():
            yield outcome(what, rig, command_for(rig, torque, rate), rate, settings, rig)
    rig = load_rig("paper_high_impedance")
    for before, after in ((0.3, 1.1), (0.3, 1.5), (0.9, 1.5), (1.5, 0.9), (1.5, 0.3)):
        late = latency(rig, before, after, 1000.0)
        yield f"sine from {before:g} to {after:g} of the edge: right after {late:.3f} s"
    for name, _ in RIGS[1:]:
        changes, top = restless(load_rig(name))
        yield f"{name}, noise flat to any frequency: {changes:.2f} changes/s at most (flat to {top:g} Hz)"
    yield "the bench is not the model (paper_high_impedance, 1 kHz): what the observer cannot know"
    for what, values in OTHERS.items():
        for top in (40.0, 100.0):
            torque = flat(round(SECONDS * 1000.0), 1000.0, top, np.random.default_rng(4))
            bench = rig.with_values(values)
            command = command_for(bench, torque, 1000.0)
            yield outcome(f"{what}, flat to {top:g} Hz", bench, command, 1000.0, settings, rig)


def signals(rate: float, edge: float, rng: np.random.Generator) -> Mapping[str, FloatArray]:
    """Return T_d by name, N m at a rate of Hz for SECONDS. edge: Hz."""
    t = np.arange(round(SECONDS * rate)) / rate
    made = {f"sine, {p:g} of the edge": 5.0 * np.sin(2 * np.pi * p * edge * t)
            for p in (0.1, 0.5, 0.8, 0.95, 1.05, 1.25, 1.6)}  # fmt: skip
    for low, high in ((0.2, 1.5), (0.5, 1.2), (0.9, 1.1)):
        two = 3.0 * np.sin(2 * np.pi * low * edge * t) + 3.0 * np.sin(2 * np.pi * high * edge * t + 1.0)
        made[f"two tones, {low:g} and {high:g} of the edge"] = two
    for top in (20.0, 40.0, 60.0, 80.0, 100.0, 140.0):
        if top < 0.5 * rate:
            made[f"flat to {top:g} Hz"] = flat(len(t), rate, top, rng)
    phase = t % 1.0  # a knee's torque: a stance bump and a swing of the other sign each second
    gait = 12.0 * np.exp(-(((phase - 0.2) / 0.09) ** 2)) + 5.0 * np.exp(-(((phase - 0.5) / 0.08) ** 2))
    gait -= 4.0 * np.exp(-(((phase - 0.8) / 0.07) ** 2))
    bursts = smooth(((t % 3.0) > 2.0).astype(float) * ((t % 3.0) < 2.6), rate, 10.0)
    made["work: steps of a gait, 1 Hz"] = gait
    made["work with knocks"] = gait + 15.0 * bursts * np.sin(2 * np.pi * 1.5 * edge * t)
    made["steps of 10 N·m"] = 10.0 * smooth(np.sign(np.sin(2 * np.pi * 0.7 * t)), rate, 60.0)
    k = np.log(min(2.0 * edge, 0.45 * rate))  # of a sweep from 1 Hz
    made["chirp, 1 Hz to twice the edge"] = 5.0 * np.sin(2 * np.pi * t[-1] / k * np.expm1(t / t[-1] * k))
    return made


def flat(n: int, rate: float, top: float, rng: np.random.Generator) -> FloatArray:
    """Return Gaussian noise of 3 N m RMS, flat to a frequency."""
    lines = np.fft.rfft(rng.standard_normal(n))
    lines[np.fft.rfftfreq(n, 1.0 / rate) > top] = 0.0
    y = np.fft.irfft(lines, n)
    return np.asarray(3.0 * y / y.std())


def smooth(y: FloatArray, rate: float, hz: float) -> FloatArray:
    """Return a signal low-passed at a frequency, without phase, around the circle."""
    f = np.fft.rfftfreq(len(y), 1.0 / rate)
    return np.fft.irfft(np.fft.rfft(y) * np.exp(-0.5 * (f / hz) ** 2), len(y))


def command_for(rig: Rig, torque: FloatArray, rate: float) -> FloatArray:
    """Return the command that makes T_d, around the circle: over T_d/T_m and the hold, N m."""
    hz = np.fft.rfftfreq(len(torque), 1.0 / rate)
    h = np.ones(len(hz), complex)
    h[1:] = frequency_response(rig, outputs.end_torque(rig, "spring_end"), hz[1:])
    h[1:] *= np.sinc(hz[1:] / rate) * np.exp(-1j * np.pi * hz[1:] / rate)
    lines = np.fft.rfft(torque) / h
    lines[0] = np.fft.rfft(torque)[0]
    return np.fft.irfft(lines, len(torque))


def outcome(
    what: str, rig: Rig, command: FloatArray, rate: float, settings: ErrorSettings, model: Rig
) -> Row:
    """Return the outcome of a model's flag on a simulated rig.

    share: median of the true RMS(T_p - T_d) / RMS(T_d). judged: part of the time outside the band; agree: of
    that. changes: of the flag, a second. longest wrong: verdict outside the band, s.
    """
    truth = true_run(rig, command, rate, seed=1)
    t, rows = observe(Observer(model), truth.record)
    flagged = ErrorFlag(model, settings)
    said = np.array([flagged.take(s, TorqueEstimate._make(row)) for s, row in zip(t, rows, strict=True)])
    share = window_rms(truth.proximal - truth.distal, rate, settings.window)
    share /= np.maximum(window_rms(truth.distal, rate, settings.window), 1e-9)
    keep = np.arange(len(share)) > SETTLE * rate
    clear = keep & (np.abs(share / settings.tolerance - 1.0) > BAND)
    wrong = clear & (said != np.where(share <= settings.tolerance, PURE, BEYOND))
    changes = np.count_nonzero(np.diff(said[keep] == PURE)) / (keep.sum() / rate)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], wrong.astype(int), [0]])))
    longest = (edges[1::2] - edges[::2]).max(initial=0) / rate
    return Row(what, "", {
        "share": f"{np.median(share[keep]):.3f}", "judged": f"{clear.sum() / keep.sum():.0%}",
        "agree": f"{1.0 - wrong.sum() / max(clear.sum(), 1):.1%}", "changes/s": f"{changes:.2f}",
        "longest wrong, s": f"{longest:.3f}",
    })  # fmt: skip


def window_rms(y: FloatArray, rate: float, window: float) -> FloatArray:
    """Return the RMS over the last seconds at every sample."""
    n = round(window * rate)
    total = np.concatenate([[0.0], np.cumsum(y**2)])
    stop = np.arange(1, len(y) + 1)
    count = np.minimum(stop, n)
    return np.sqrt((total[stop] - total[stop - count]) / count)


def _verdict(flagged: ErrorFlag, t: float, distal: float, proximal: float) -> str:
    return flagged.take(t, TorqueEstimate(distal, proximal, 0.0, 0.01, 0.01, 0.01))


def latency(rig: Rig, before: float, after: float, rate: float) -> float:
    """Return s from a sine at a part of the edge turning into one at another until the verdict is right."""
    end, worst = end_to_end(rig), 0.0
    right = PURE if after < 1.0 else BEYOND
    for phase in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        flagged = ErrorFlag(rig)
        for k in range(round(3.0 * rate)):
            t = k / rate
            f = flagged.edge.hz * (before if t < 1.5 else after)
            turn = np.exp(1j * (2.0 * np.pi * f * (t - 1.5) + phase))
            said = _verdict(flagged, t, 5.0 * turn.real, 5.0 * (turn / end(2j * np.pi * f)).real)
            if said != right and t >= 1.5:
                worst = max(worst, t - 1.5)
    return worst


def restless(rig: Rig) -> tuple[float, float]:
    """Return the most changes a second on a minute of flat noise, and up to where that was flat, Hz.

    Exact torques at 1 kHz: T_p is T_d over H, around the circle.
    """
    rate, count, rng = 1000.0, 60_000, np.random.default_rng(0)
    hz, function = np.fft.rfftfreq(count, 1.0 / rate), end_to_end(rig)
    inverse = np.array([1.0 / function(2j * np.pi * f) for f in hz])
    worst = (0.0, 0.0)
    for top in np.arange(10.0, 120.0, 8.0):
        torque = flat(count, rate, float(top), rng)
        other = np.fft.irfft(np.fft.rfft(torque) * inverse, count)
        flagged = ErrorFlag(rig)
        pairs = enumerate(zip(torque.tolist(), other.tolist(), strict=True))
        said = [_verdict(flagged, k / rate, d, p) for k, (d, p) in pairs]
        worst = max(worst, (np.count_nonzero(np.diff(said[1000:])) / 59.0, float(top)))
    return worst
