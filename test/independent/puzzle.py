"""The paper's own puzzle (section 3.2.2): a moving output that goes "out of sync" around 19 Hz."""

import numpy as np
from independent.bench import drawn_bench, record_run

RESONANCE = {"frequency": 33.0, "damping_ratio": 0.03, "participation": 0.6}
DELAY = 1.5 / 280.0
"""s: one and a half samples, 37 degrees at 19 Hz."""


def noisy_resonance(seed, duration=160.0):
    """Record of a bench with a resonance at 33 Hz and a sensor that is mostly noise above 19 Hz.

    The coherence of ft with the command is about 1 below 19 Hz, a half at 20 Hz and at the resonance,
    and less than 0.3 elsewhere above.
    """
    bench = drawn_bench(np.random.default_rng(seed), "moving_output").with_values(
        resonance=RESONANCE["participation"],
        resonance_omega=2.0 * np.pi * RESONANCE["frequency"],
        resonance_zeta=RESONANCE["damping_ratio"],
        ft_crosstalk=14.0,
        ft_crosstalk_low=19.0,
        ft_crosstalk_high=140.0,
    )
    return record_run(bench, seed + 1, "white_noise", duration)


def delayed_record(seed, duration=160.0):
    """Record of a bench whose commands act one and a half samples late, with a good sensor."""
    bench = drawn_bench(np.random.default_rng(seed), "moving_output").with_values(delay=DELAY)
    return record_run(bench, seed + 1, "white_noise", duration)
