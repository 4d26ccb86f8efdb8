"""Residuals and cases for the tests of coloured noise."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

RATE = 256.0


def white(size, seed=0):
    return np.random.default_rng(seed).normal(size=size)


def case(y, rate=RATE, mask=None):
    """A case of one channel, at whose command and motion nobody looks."""
    t = np.arange(len(y)) / rate
    return SimpleNamespace(
        t={"ft": t},
        mask={"ft": np.ones(len(y), bool) if mask is None else mask},
        measured={"ft": y},
        drive=SimpleNamespace(t=t, torque=np.sin(3.0 * t), q=np.cos(5.0 * t), v=np.sin(7.0 * t)),
    )
