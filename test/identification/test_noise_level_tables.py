"""The noise after a fit as tables: what residuals of known power leave, and what passes for noise."""

import math
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from rsea_ros.identification import noise_level
from rsea_ros.identification.noise import unit_spectra
from rsea_ros.identification.noise_level import _coherent_share, is_noise, reestimate_noise
from rsea_ros.identification.problem import Case
from rsea_ros.model.drive import Drive

RATE, START = 256.0, 10.25
NONE = np.zeros(0)
DRIVE = Drive(1 / RATE, START, np.zeros(4096), {}, {}, NONE, NONE, (0.0, 0.0))
MOTION = SimpleNamespace(t=np.array([START, START + 16.0]))
"""As of a bare drive, whose torque is filtered before it is compared."""


def alternate(amplitude, size=4096):
    """A residual of exactly that RMS."""
    return np.resize([1.0, -1.0], size) * amplitude


def case(noise, drive=DRIVE, least=None, mask=None, first=START, **measured):
    times = {n: first + np.arange(len(y)) / RATE for n, y in measured.items()}
    masks = {n: np.ones(len(y), bool) for n, y in measured.items()}
    return Case(drive, times, measured, MappingProxyType(noise), {**masks, **(mask or {})}, least=least or {})


class World:
    """Scripted measures. white: by size, level and flatness of the top of the band. noises: accepted."""

    def __init__(self, monkeypatch):
        self.white, self.noises = {}, set()
        monkeypatch.setattr(noise_level, "is_noise", lambda case, outputs, n, *_: n in self.noises)
        monkeypatch.setattr(noise_level.noises, "top_of_band", lambda left, seams: self.white[len(left)])

    def known(self, case):
        return reestimate_noise(case, {n: np.zeros(len(y)) for n, y in case.measured.items()})


@pytest.fixture
def world(monkeypatch):
    return World(monkeypatch)


# of 4096 samples the white part is doubtful to 1.5/64: coloured is what lies 4 x 1.5/64 = 9.4 % above it
@pytest.mark.parametrize(
    ("before", "white", "flat", "drive", "passes", "after", "coloured"),
    [
        (2.0, 0.97, True, DRIVE, True, 0.97, False),  # its white part, and next to nothing above it
        (2.0, 0.95, True, DRIVE, True, 1.0, False),  # above it, but no more than chance may be
        (2.0, 0.90, True, DRIVE, True, 1.0, True),
        (2.0, 0.90, True, DRIVE, False, 0.90, False),  # a misfit: only the white part is noise
        (0.5, 0.90, True, DRIVE, True, 1.0, True),
        (0.5, 0.90, True, DRIVE, False, 0.5, False),  # a floor never rises by a misfit
        (2.0, 0.50, False, DRIVE, False, 1.0, False),  # not flat: no more than all of the residual
        (0.5, 0.10, False, DRIVE, False, 0.5, False),
        (2.0, 0.50, True, MOTION, False, 1.0, False),  # filtered: the top of the band says nothing
    ],
)
def test_the_noise_follows_from_the_residual(world, before, white, flat, drive, passes, after, coloured):
    world.white = {4096: (white, flat)}
    world.noises = {"ft"} if passes else set()
    known = world.known(case({"ft": before}, drive, ft=alternate(1.0)))
    assert known.noise == pytest.approx({"ft": after})
    assert known.coloured == ({"ft"} if coloured else set())


@pytest.mark.parametrize(("least", "after"), [({"ft": 3.0}, 3.0), ({"ft": 0.1}, 0.97), ({}, 0.97)])
def test_the_noise_is_never_below_the_least(world, least, after):
    world.white = {4096: (0.97, True)}
    known = world.known(case({"ft": 2.0}, least=least, ft=alternate(1.0)))
    assert known.noise == pytest.approx({"ft": after}, rel=1e-12)


@pytest.mark.parametrize(("size", "rms", "coloured"), [(4096, 1.09375, False), (4096, 1.0938, True),
                                                     (65536, 1.0401, True), (256, 1.374, False),
                                                     (256, 1.376, True)])  # fmt: skip
def test_a_short_record_must_lie_farther_above_to_be_coloured(world, size, rms, coloured):
    world.white, world.noises = {size: (1.0, True)}, {"ft"}
    known = world.known(case({"ft": 2.0}, ft=alternate(rms, size)))
    assert (known.coloured == {"ft"}) is coloured


def test_a_misfit_of_one_channel_leaves_no_other_coloured(world):
    world.white, world.noises = {4096: (0.5, True), 2048: (0.5, True)}, {"ft"}
    both = case({"ft": 9.0, "position": 9.0}, ft=alternate(1.0), position=alternate(1.0, 2048))
    known = world.known(both)
    assert known.noise == {"ft": 0.5, "position": 0.5} and known.coloured == set()
    world.noises = {"ft", "position"}
    known = world.known(both)
    assert known.noise == {"ft": 1.0, "position": 1.0} and known.coloured == {"ft", "position"}


def test_only_valid_samples_of_simulated_channels_count(world):
    world.white = {3096: (0.5, False), 100: (0.5, True)}  # from the first sample that counts
    y, keep = alternate(1.0), np.ones(4096, bool)
    y[:1000], keep[:1000] = 50.0, False
    before = {"ft": 9.0, "position": 7.0, "velocity": 8.0}
    made = case(
        before, ft=y, position=alternate(1.0, 100), velocity=alternate(1.0, 200),
        mask={"ft": keep, "position": np.zeros(100, bool)},
    )  # fmt: skip
    outputs = {"ft": np.zeros(4096), "position": np.zeros(100)}
    assert reestimate_noise(made, outputs).noise == {"ft": 1.0, "position": 7.0, "velocity": 8.0}


SQRT3 = math.sqrt(3.0)


def seconds(*amplitudes):
    """A residual whose RMS is given second by second."""
    return np.concatenate([alternate(a, 256) for a in amplitudes])


@pytest.mark.parametrize(
    ("left", "first", "gone", "rms", "doubt"),
    [
        (seconds(*[1.0] * 16), START, None, 1.0, 0.0),
        # powers 1 and 3 by turns: 2 on average, off by 1: half of that, over sqrt(2 x 16), in the RMS
        (seconds(*[1.0, SQRT3] * 8), START, None, math.sqrt(2.0), 0.0625),
        (seconds(1.0), START, None, 1.0, 0.0),  # one block says nothing
        (seconds(*[1.0, SQRT3] * 8), START - 2.0, None, math.sqrt(2.0), 0.0625),  # begins before the command
        # a gap of six seconds: ten blocks are left
        (seconds(*[1.0, SQRT3] * 8), START, slice(4 * 256, 10 * 256), math.sqrt(2.0), 0.25 / math.sqrt(10.0)),
        # one sample is left of the last second
        (seconds(1.0, 1.0, 1.0, SQRT3), START, slice(3 * 256 + 1, None), None, 0.25 * SQRT3 / 1.5 / 2.0),
    ],
)
def test_coloured_noise_has_an_allowance_for_its_doubt(world, left, first, gone, rms, doubt):
    """Two standard deviations of the RMS, from how the power varies from second to second."""
    keep = np.ones(len(left), bool)
    if gone is not None:
        keep[gone] = False
    world.white, world.noises = {int(np.flatnonzero(keep)[-1]) + 1: (0.1, True)}, {"ft"}
    rms = float(np.sqrt(np.mean(left[keep] ** 2))) if rms is None else rms
    known = world.known(case({"ft": 9.0}, mask={"ft": keep}, first=first, ft=left))
    assert known.coloured == {"ft"}
    assert known.noise["ft"] == pytest.approx(rms * (1.0 + 2.0 * doubt), rel=1e-9)


def white(size, seed=0):
    return np.random.default_rng(seed).normal(size=size)


def recorded(y, rate=RATE):
    """A case of one channel, measured beside an output of zero, with a motion of which it shows nothing."""
    t = np.arange(len(y)) / rate
    drive = SimpleNamespace(t=t, torque=np.sin(3.0 * t), q=np.cos(5.0 * t), v=np.sin(7.0 * t))
    all_count = {"ft": np.ones(len(y), bool)}
    return SimpleNamespace(t={"ft": t}, mask=all_count, measured={"ft": y}, drive=drive, filters={})


def passes(y, **more):
    return is_noise(recorded(y, **more), {"ft": np.zeros(len(y))}, "ft")


def test_short_and_empty_records_decide_nothing():
    assert passes(white(1500)) and not passes(white(1499))
    assert not passes(np.zeros(2000))
    assert passes(np.where(np.arange(2000) % 9, white(2000), 0.0)), "some zeros are allowed"


@pytest.mark.parametrize(("rate", "memory"), [(100.0, 0.97), (256.0, 0.0), (256.0, 0.9), (1000.0, 0.97)])
def test_noise_of_first_order_passes(rate, memory):
    assert passes(lfilter([1.0], [1.0, -memory], white(9000, seed=3))[1000:], rate=rate)


T = np.arange(8192) / RATE
MISFITS = {
    "an offset": (0.25, 0.4, np.ones(8192)),
    "a drift": (0.3, 1.0, np.linspace(-1.0, 1.0, 8192)),
    "a slow wave": (0.1, 0.15, np.sin(2 * math.pi * 0.15 * T)),
    "a line": (0.2, 0.35, np.sin(2 * math.pi * 40.0 * T)),
    "knocks": (4.0, 5.0, np.where(np.arange(8192) % 256 == 0, 1.0, 0.0)),
    "more of it later": (0.5, 0.65, np.where(T > 16.0, white(8192, seed=8), 0.0)),
    "of the command": (0.15, 0.3, np.sin(3.0 * T) ** 3),
}
"""Its size, of the noise, that still passes; the one that is seen; and its course."""


@pytest.mark.parametrize("misfit", MISFITS)
def test_a_misfit_in_noise_passes_only_while_it_is_small(misfit):
    small, large, course = MISFITS[misfit]
    noise = white(8192, seed=4)
    assert passes(noise + small * course)
    assert not passes(noise + large * course)


def test_a_ripple_over_the_rotors_angle_is_a_misfit_once_the_gears_ratio_is_known():
    turning = recorded(white(8192, seed=4) + 0.45 * np.sin(50.2 * np.sin(2.0 * T)))
    turning.drive.q = 0.1 * np.sin(2.0 * T)
    outputs = {"ft": np.zeros(8192)}
    assert is_noise(turning, outputs, "ft")
    assert not is_noise(turning, outputs, "ft", ratio=502.0)


def test_kurtosis_is_that_of_the_whitened_residual():
    """Smoothing makes anything Gaussian; what was smoothed is not. Flatter than Gaussian is noise too."""
    rng = np.random.default_rng(2)
    assert not passes(lfilter([1.0], [1.0, -0.97], rng.standard_t(5, 2**16)))
    assert passes(lfilter([1.0], [1.0, -0.97], rng.uniform(-1.0, 1.0, 2**16)))


def share(a, b):
    return _coherent_share(unit_spectra(a, 512, 16), unit_spectra(b, 512, 16), RATE)


@pytest.mark.parametrize(("gain", "expected"), [(0.0, 0.0), (0.5, 0.2), (-1.0, 0.5), (1e6, 1.0)])
def test_the_coherent_share_of_the_power_is_measured(gain, expected):
    witness = white(2**15, seed=1)
    assert share(white(2**15) + gain * witness, 1e3 * witness) == pytest.approx(expected, abs=0.04)


def test_coherence_is_corrected_for_chance():
    """Of 16 segments, 31 half overlapping, one in 29 of the power agrees by chance, in no band more."""
    one_band = [share(white(8192, seed=k), white(8192, seed=1000 + k)) for k in range(40)]
    assert -0.01 < np.mean(one_band) < 0.05  # the worst of four bands
