"""Fixed policies that designed experiments are compared with: pieces of a chirp or of a random multisine."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from rsea_ros.experiment.campaign import Rules
from rsea_ros.experiment.proposal import peaks
from rsea_ros.experiment.run_design import propose
from rsea_ros.experiment.run_shape import at_rest_around
from rsea_ros.identification.excitation import ExcitationSettings, chirp, ramp_ends

RATE, CHIRP = 280.0, 20.0
"""Hz; s."""
MOST = 0.99
"""Largest RMS of a clipped multisine as a share of its limit."""


class Fixed:
    """Plays pieces of a command one after another, each as long as all before it together."""

    def __init__(self, command, shortest):
        self._command, self._at, self._shortest = command, 0, round(shortest * RATE)

    def __call__(self, hypotheses, asked, noise, run, tell):
        size = max(self._shortest, self._at)
        piece = self._command[self._at : self._at + size]
        self._at += len(piece)
        chances = (1.0,) * len(hypotheses)
        if hypotheses[0].probability >= Rules.confirmed:  # what a run within the limits could still show
            chances = propose(hypotheses, asked, noise, run, tell).chances
        run = ramp_ends(piece, min(round(0.25 * RATE), len(piece) // 4))
        return _Played(run, tuple(h.name for h in hypotheses), chances)


class _Played:
    """The part of a proposal that the campaign uses."""

    def __init__(self, run, names, chances):
        command = at_rest_around(run, RATE)
        self.command, self.duration, self.rate = command, len(run) / RATE, RATE
        self.names, self.chances = names, chances
        self.decided = self.resolved = 1.0
        self.peaks = peaks(command, RATE, ())
        self.hopeless, self.energy = (), float(np.sum(command**2) / RATE)


def fixed_chirp(limits):
    """Return the paper's chirp without its noise, at the torque limit, N m."""
    return chirp(
        ExcitationSettings(rate=RATE, duration=CHIRP, amplitude=limits.torque * 0.98, noise=0.0, low=0.05)
    )


def random_multisine(rms, seed, torque):
    """Return a multisine of random phases and equal lines in 0.5 to 100 Hz of some RMS, 20 s, N m.

    Clipped at the limit, and so much larger before that its RMS afterwards is as asked. Without clipping, its
    peak would be about four times its RMS.
    """
    rng = np.random.default_rng(seed)
    n = round(CHIRP * RATE)
    spectrum = np.zeros(n // 2 + 1, complex)
    lines = np.arange(round(0.5 * CHIRP), round(100.0 * CHIRP))
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    signal = np.fft.irfft(spectrum, n)
    signal, asked = signal / signal.std(), min(rms, MOST * torque)

    def excess(log_size):
        return float(np.std(np.clip(np.exp(log_size) * signal, -torque, torque)) - asked)

    size = np.exp(brentq(excess, np.log(0.5 * asked), np.log(1e4 * torque)))
    return np.clip(size * signal, -torque, torque)
