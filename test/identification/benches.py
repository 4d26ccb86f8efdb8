"""Records of simulated benches whose true values are drawn from the rig's own spread."""

import numpy as np
from runs import excited

from rsea_ros.model.rig_file import load_rig


def bench(name, seed):
    """Return a rig as its file has it, and the true one, values off by up to two sigma."""
    nominal, rng = load_rig(name), np.random.default_rng(seed)
    off = {n: nominal.spread(n) * np.clip(rng.standard_normal(), -2.0, 2.0) for n in nominal.free()}
    return nominal, nominal.with_values({n: nominal[n] * np.exp(d) for n, d in off.items()})


def record_bench(true, seed, duration=10.0, kind="white_noise"):
    """Return what the sensors of a bench log."""
    return excited(true, kind, sensors=seed, duration=duration, seed=seed, amplitude=15.0)
