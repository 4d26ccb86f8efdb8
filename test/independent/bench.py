"""The second bench: a command goes in, the record that this machine would have logged comes out.

It stands in for a real bench in tests and benchmarks of the diagnosis. Its solver is Runge-Kutta 4 with
24 steps a sample; test_bench.py holds it against the model, effect by effect.
"""

import numpy as np
from independent.equations import CURRENT, DC, DG, DH, C as CHASSIS, G as GEAR, H, sensor_torques
from independent.excitations import EXCITATIONS, RATE
from independent.plant import Bench, Outside, Plant
from independent.solvers import run_fixed
from numba import njit

from rsea_ros.records.record import Channel, Record


def drawn_bench(rng, setup="high_impedance"):
    """Return a bench whose inertia, damping and stiffness differ from Table 2 by up to 15, 10 and 3 %."""
    plant = Plant()
    values = {
        "j_m": plant.j_m * rng.uniform(0.85, 1.15),
        "b_m": plant.b_m * rng.uniform(0.90, 1.10),
        "k_s": plant.k_s * rng.uniform(0.97, 1.03),
        "b_s": plant.b_s * rng.uniform(0.90, 1.10),
        "housing_free": float(setup == "moving_output"),
    }
    return Bench().with_values(**values)


def record_run(bench, seed, excitation="chirp_noise", duration=60.0, solver=run_fixed):
    """Return the Record of one run with a command and noise of its own."""
    rng = np.random.default_rng(seed)
    return record_command(bench, EXCITATIONS[excitation](duration, rng), rng, solver=solver)


def record_command(bench, command, rng, solver=run_fixed, rate=RATE):
    """Return the Record of a run with this command (N m, shape (n,)), held for 1/rate each."""
    period = 1.0 / rate
    plant = bench.plant._replace(duration=command.size * period)
    knock = _knocks(command.size, bench.outside, rng, rate)
    states, held = solver(_drive(command, bench.outside, period), knock, period, plant)
    starts = np.arange(command.size) * period
    ends = _stamp(starts + period, bench.outside)
    measured = _measure(states, held, starts + period, plant, bench.outside, rng)
    channels = {name: Channel(ends.copy(), y) for name, y in measured.items()}
    stamps = _stamp(starts, bench.outside)
    return Record({"command": Channel(stamps, command.copy()), **channels}, "second bench")


def _drive(command, outside, period):
    """Return the command after the drive: dead band, limit of rate, saturation."""
    u = np.where(np.abs(command) < outside.deadband, 0.0, command)
    if np.isfinite(outside.rate_limit):
        u = _rate_limited(u, outside.rate_limit * period)
    return np.clip(u, -outside.saturation, outside.saturation)


@njit(cache=True)
def _rate_limited(u, step):
    out = np.empty_like(u)
    last = 0.0
    for k in range(u.size):
        last += min(max(u[k] - last, -step), step)
        out[k] = last
    return out


def _knocks(n, outside, rng, rate):
    """Half-sine knocks of 8 samples at random times, N m, shape (n,)."""
    knock = np.zeros(n)
    if outside.impact_torque > 0.0:
        shape = np.sin(np.pi * (np.arange(8) + 0.5) / 8)
        for at in np.flatnonzero(rng.random(n) < outside.impact_rate / rate):
            part = knock[at : at + 8]
            part += (
                outside.impact_torque * rng.choice((-1.0, 1.0)) * rng.uniform(0.5, 1.5) * shape[: part.size]
            )
    return knock


def _measure(states, held, t, plant, outside, rng):
    """Return position, velocity, motor_torque and ft as sampled, each shape (n,)."""
    on_chassis = plant.encoder_on_chassis and (plant.gap or plant.gear_k)
    at, rate = (CHASSIS, DC) if on_chassis else (GEAR, DG)
    angle, speed = states[:, at] - states[:, H], states[:, rate] - states[:, DH]
    wave = outside.eccentricity_cycles * plant.ratio
    angle, speed = (
        angle + outside.eccentricity * np.sin(wave * angle),
        speed * (1.0 + outside.eccentricity * wave * np.cos(wave * angle)),
    )
    lagged = plant.current_tau > 0.0 or plant.current_omega > 0.0
    current = states[:, CURRENT] if lagged else held
    n = t.size
    return {
        "position": _round(angle, outside.position_quantum),
        "velocity": _round(speed + outside.velocity_noise * rng.normal(size=n), outside.velocity_quantum),
        "motor_torque": _round(current + outside.motor_noise * rng.normal(size=n), outside.motor_quantum),
        "ft": _round(_force_torque(states, t, plant, outside, rng), outside.ft_quantum),
    }


def _force_torque(states, t, plant, outside, rng):
    """Return the F/T sensor's reading, N m: gain, bias, drifts, interference and noise of its own."""
    true = sensor_torques(t, states, plant)
    share = t / plant.duration
    reading = outside.ft_gain * true + outside.ft_quadratic * true**2 + outside.ft_bias
    reading += outside.ft_drift * share
    reading += outside.ft_thermal * -np.expm1(-t / outside.ft_thermal_tau)
    any_phase = 2.0 * np.pi * rng.random()
    phase = any_phase if np.isnan(outside.hum_phase) else outside.hum_phase
    reading += outside.hum * np.sin(2.0 * np.pi * outside.hum_frequency * t + phase)
    reading += outside.ft_walk * np.sqrt(t[1] - t[0]) * np.cumsum(rng.normal(size=t.size))
    return reading + _crosstalk(t, outside, rng) + outside.ft_noise * rng.normal(size=t.size)


def _crosstalk(t, outside, rng):
    """Gaussian noise within a band, N m RMS as asked, shape (n,)."""
    spectrum = np.fft.rfft(rng.normal(size=t.size))
    f = np.fft.rfftfreq(t.size, t[1] - t[0])
    spectrum[(f < outside.ft_crosstalk_low) | (f > outside.ft_crosstalk_high)] = 0.0
    noise = np.fft.irfft(spectrum, t.size)
    return outside.ft_crosstalk * noise / noise.std()


def _round(y, quantum):
    return np.round(y / quantum) * quantum if quantum > 0.0 else y


def _stamp(t, outside):
    """Return stamps as a clock of 64-bit floating point seconds has them."""
    return _round(t, outside.stamp_quantum)


__all__ = ["Bench", "Outside", "Plant", "drawn_bench", "record_command", "record_run"]
