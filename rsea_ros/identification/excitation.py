"""Excitations: torque commands on a uniform grid, N m.

Every kind is a function of one `ExcitationSettings`, in KINDS under the name by which the excite node and the
command line choose it. `excitation()` adds the ramps.
"""

import math
from dataclasses import dataclass

import numpy as np

from rsea_ros.documents.units import plain
from rsea_ros.errors import ParameterError
from rsea_ros.records.record import FloatArray, IntArray

NYQUIST_SHARE = 0.95
"""No excitation goes above this share of half the sample rate."""
FEWEST_SAMPLES = 10
"""Of a command that a simulation can be driven with (see drive_from)."""
MOST_SAMPLES = 2e7
"""Of a command: 10 hours at 500 Hz; more is a slip of the pen that would take all memory."""
_DETECTION_GROUP = 4


@dataclass(frozen=True)
class ExcitationSettings:
    """The settings of an excitation.

    rate: Hz. duration: s, without the ramps of periodic kinds. amplitude: N m, peak of chirp and steps, rms
    of multisine and white noise. noise: N m, standard deviation of the noise on top of the chirp. low, high:
    band, Hz. period: s, of the multisine and of a full cycle of steps. seed: of everything random.
    """

    rate: float = 280.0
    duration: float = 160.0
    amplitude: float = 20.0
    noise: float = 10.0
    low: float = 0.01
    high: float = 140.0
    period: float = 10.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, unit in (("rate", "Hz"), ("duration", "s"), ("low", "Hz"), ("period", "s")):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ParameterError(f"excitation: {name} = {value:g} {unit}, expected > 0 {unit}")
        if not FEWEST_SAMPLES <= self.duration * self.rate <= MOST_SAMPLES:
            raise ParameterError(
                f"excitation: duration = {self.duration:g} s at {self.rate:g} Hz, "
                f"expected {FEWEST_SAMPLES} to {MOST_SAMPLES:g} samples"
            )
        if not self.low < self.top:
            raise ParameterError(f"excitation: low = {self.low:g} Hz, expected below {self.top:g} Hz")

    @property
    def top(self) -> float:
        """Highest frequency, Hz: `high`, kept below Nyquist."""
        return min(self.high, NYQUIST_SHARE * self.rate / 2.0)

    @property
    def samples(self) -> int:
        """Samples of the whole duration."""
        return round(self.duration * self.rate)


JOINT = ExcitationSettings(rate=100.0, amplitude=0.4, noise=0.03, low=0.05, high=3.0)
"""What suits a joint that positions command: amplitude and noise in rad."""


def chirp(settings: ExcitationSettings) -> FloatArray:
    """Return the paper's excitation: a logarithmic sweep with white noise on top (section 3.2.1).

        u(t) = A sin(2 pi low T / ln r ((r)^(t/T) - 1)) + w(t),   r = top / low

    The paper has A = 20 N m, 0.01-140 Hz, T = 160 s and w of 10 N m standard deviation in the same band.
    """
    t = np.arange(settings.samples) / settings.rate
    log_ratio = math.log(settings.top / settings.low)
    turns = settings.low * settings.duration / log_ratio * np.expm1(log_ratio * t / settings.duration)
    sweep: FloatArray = settings.amplitude * np.sin(2.0 * np.pi * turns)
    return sweep + _band_noise(settings, settings.noise)


def white_noise(settings: ExcitationSettings) -> FloatArray:
    """Return Gaussian white noise between low and top, `amplitude` N m rms."""
    return _band_noise(settings, settings.amplitude)


def steps(settings: ExcitationSettings) -> FloatArray:
    """Return steps 0, A, 0, -A, each held for a quarter of `period`."""
    quarter = np.floor(np.arange(settings.samples) / settings.rate * 4.0 / settings.period + 1e-9)
    levels = np.array([0.0, settings.amplitude, 0.0, -settings.amplitude])
    return levels[quarter.astype(np.int64) % 4]


def multisine(settings: ExcitationSettings) -> FloatArray:
    """Return whole periods of a random-phase multisine on odd harmonics, `amplitude` N m rms.

        u(t) = sqrt(2 / K) A sum_k cos(2 pi k t / period + phi_k),   k in odd_lines(settings)

    The omitted odd lines show odd distortion, the even ones even distortion (Pintelon, Schoukens, System
    Identification, 2nd ed., section 4.3). Raises ParameterError for a period that is not a whole number of
    samples or does not fit the duration.
    """
    size = _period_samples(settings)
    lines = odd_lines(settings)
    spectrum = np.zeros(size // 2 + 1, complex)
    phases = np.random.default_rng([settings.seed, 1]).uniform(0.0, 2.0 * np.pi, len(lines))
    spectrum[lines] = np.exp(1j * phases)
    period = np.fft.irfft(spectrum, size) * size * settings.amplitude / math.sqrt(2.0 * len(lines))
    return np.tile(period, settings.samples // size)


def odd_lines(settings: ExcitationSettings) -> IntArray:
    """Return the excited harmonics of 1/period: odd ones in the band, one of each four left out at random."""
    first, last = math.ceil(settings.low * settings.period), math.floor(settings.top * settings.period)
    odd = np.arange(first + (first + 1) % 2, last + 1, 2)
    if len(odd) < 1:
        band = f"{settings.low:g} to {settings.top:g} Hz"
        raise ParameterError(
            f"multisine: period = {settings.period:g} s, expected one with odd lines in {band}"
        )
    rng = np.random.default_rng([settings.seed, 0])
    groups = len(odd) // _DETECTION_GROUP
    left_out = _DETECTION_GROUP * np.arange(groups) + rng.integers(0, _DETECTION_GROUP, groups)
    return np.delete(odd, left_out)


def _period_samples(settings: ExcitationSettings) -> int:
    size = round(settings.period * settings.rate)
    where = f"multisine: period = {settings.period:g} s"
    if abs(size - settings.period * settings.rate) > 1e-6 * size:
        raise ParameterError(f"{where}, expected a whole number of samples at {settings.rate:g} Hz")
    if size > settings.samples:
        raise ParameterError(f"{where}, expected at most the duration of {settings.duration:g} s")
    return size


def _band_noise(settings: ExcitationSettings, deviation: float) -> FloatArray:
    """Return Gaussian noise that is white from low to top and nothing elsewhere. deviation: N m.

    Raises ParameterError where the band has no line: it is narrower than 1 / duration.
    """
    n = settings.samples
    if deviation == 0.0:
        return np.zeros(n)
    spectrum = np.fft.rfft(np.random.default_rng(settings.seed).standard_normal(n))
    frequency = np.fft.rfftfreq(n, 1.0 / settings.rate)
    inside = (frequency >= settings.low) & (frequency <= settings.top)
    if not inside.any():
        raise ParameterError(
            f"excitation: no line of {settings.duration:g} s in {settings.low:g} to {settings.top:g} Hz, "
            "expected a longer duration or a wider band"
        )
    spectrum[~inside] = 0.0
    share = 2.0 * np.count_nonzero(inside) / n
    return np.fft.irfft(spectrum, n) * (deviation / math.sqrt(share))


KINDS = {"chirp": chirp, "multisine": multisine, "white_noise": white_noise, "steps": steps}
PERIODIC = frozenset({"multisine"})


def excitation(kind: str, settings: ExcitationSettings, ramp: float = 0.0) -> FloatArray:
    """Return a command that begins and ends at rest, N m, shape (n,).

    ramp: s, raised cosine in and out. Periodic kinds get it before and after, as their own continuation, so
    that their periods stay whole; the others are shaped within their duration.
    Raises ParameterError for an unknown kind and for a ramp longer than half the duration.
    """
    if kind not in KINDS:
        raise ParameterError(f"excitation {kind!r}, expected one of {', '.join(KINDS)}")
    command = KINDS[kind](settings)
    n = round(ramp * settings.rate)
    if not 0 <= 2 * n <= len(command):
        longest = len(command) / settings.rate / 2.0
        raise ParameterError(f"excitation: ramp = {ramp:g} s, expected 0 to {longest:g} s")
    if kind in PERIODIC:
        command = np.concatenate([command[len(command) - n :], command, command[:n]])
    return ramp_ends(command, n)


def ramp_ends(command: FloatArray, n: int) -> FloatArray:
    """Return the command with its first and last n samples under a raised cosine, (1 - cos(pi k / n)) / 2."""
    window = np.ones(len(command))
    rise = 0.5 * (1.0 - np.cos(np.pi * np.arange(n) / max(n, 1)))
    window[:n] = rise
    window[len(command) - n :] *= rise[::-1]
    return command * window


def check_limits(command: FloatArray, limit: float, rate: float, unit: str = "N m") -> None:
    """Raise ParameterError for the first sample above the limit (in unit) or not finite. rate: Hz."""
    bad = ~(np.abs(command) <= limit)
    if bad.any():
        unit = plain(unit)
        first = int(np.argmax(bad))
        largest = np.max(np.abs(command))
        raise ParameterError(
            f"command of {command[first]:.4g} {unit} at {first / rate:.3f} s (largest {largest:.4g} {unit}), "
            f"expected at most {limit:g} {unit} either way"
        )
