"""The properties that the effects claim, checked against the simulation."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from effect_bench import NOISE, ON_THE_BENCH, RIG, command, difference, drive, record_of, rms, simulate
from scipy.optimize import least_squares

from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.drive import drive_from

every_effect = pytest.mark.parametrize("effect", ON_THE_BENCH, ids=lambda e: e.name)
PASSIVE = [e for e in ON_THE_BENCH if e.claims.passive]
PAIRS = [(e, rival) for e in ON_THE_BENCH for rival in e.claims.confusable_with]
NOMINAL = ("rotor.reflected_inertia", "rotor.reflected_damping", "spring.stiffness", "spring.damping")


def change(effect, driven):
    """Return what the effect changes at its typical size, in units of the noise."""
    return difference(simulate(driven, effect.name, effect.typical), simulate(driven))


@every_effect
def test_an_effect_shows_most_in_its_stated_channel(effect):
    driven = drive(duration=10.0)
    nominal, extended = simulate(driven), simulate(driven, effect.name, effect.typical)
    shows = {n: rms(extended[n] - nominal[n]) / noise for n, noise in NOISE.items()}
    assert shows[effect.claims.channel] == max(shows.values()), shows


@every_effect
def test_an_effect_has_its_stated_parity(effect):
    forward, backward = (change(effect, drive(amplitude=a)) for a in (20.0, -20.0))
    odd, even = rms(forward - backward) / 2, rms(forward + backward) / 2
    share = even / (odd + even)
    low, high = {"odd": (0.0, 1e-6), "even": (0.9, 1.0), "neither": (0.1, 0.9)}[effect.claims.parity]
    assert low <= share <= high


@every_effect
def test_an_effect_grows_with_the_amplitude_as_stated(effect):
    sizes = [rms(change(effect, drive(amplitude=a))) for a in (6.0, 12.0, 24.0)]
    exponents = np.diff(np.log2(np.maximum(sizes, 1e-6)))
    if effect.claims.amplitude_exponent is None:
        assert np.ptp(exponents) > 0.1 or abs(exponents[0] - np.rint(exponents[0])) > 0.1
    else:
        assert np.abs(exponents - effect.claims.amplitude_exponent).max() < 0.25


@pytest.mark.parametrize("effect", PASSIVE, ids=lambda e: e.name)
def test_a_passive_effect_only_takes_energy(effect):
    rig = RIG.with_values({"rotor.reflected_damping": 0.0, "spring.damping": 0.0})
    silence = replace(command(280.0, 5.0), y=np.zeros(1400))
    thrown = drive_from(record_of(silence, start=(0.6 / 280.0, 0.6)))  # a period after it began at 0
    free = simulate(thrown, rig=rig)
    inertia = rig["rotor.reflected_inertia"] + rig["chassis.inertia"]
    at_start = inertia * 0.6**2 / 2
    energy = inertia * free["velocity"] ** 2 / 2 + rig["spring.stiffness"] * free["position"] ** 2 / 2
    np.testing.assert_allclose(energy, at_start, rtol=1e-9)
    motion = simulate(thrown, effect.name, effect.typical, rig)
    deflection = np.minimum(abs(motion["position"]), abs(motion["ft"]) / rig["spring.stiffness"])
    energy = inertia * motion["velocity"] ** 2 / 2 + rig["spring.stiffness"] * deflection**2 / 2
    assert energy.max() < at_start * (1 + 5e-4)


@pytest.mark.parametrize(("effect", "rival"), PAIRS, ids=lambda v: v if isinstance(v, str) else v.name)
def test_a_rival_explains_most_of_what_a_refit_leaves(effect, rival):
    driven, measured, left = _left_of(effect.name)
    assert _misfit(driven, measured, catalogue()[rival]) < left / 2


@cache
def _left_of(name):
    """Return a drive, what an effect makes of it, and what a refit of the nominal rig leaves of that."""
    driven = drive(duration=2.5)
    measured = simulate(driven, name, catalogue()[name].typical)
    return driven, measured, _misfit(driven, measured, None)


def _misfit(driven, measured, other):
    """Return the least sum of squares of the nominal rig, or of that with another effect, refitted."""
    nominal = np.array([RIG[n] for n in NOMINAL])
    parameters = other.parameters if other else ()
    low = np.concatenate([0.3 * nominal, [p.low for p in parameters]])
    high = np.concatenate([3.0 * nominal, [p.high for p in parameters]])
    scale = np.concatenate([nominal, [abs(p.typical) or 1.0 for p in parameters]])

    def residual(theta):
        rig = RIG.with_values(dict(zip(NOMINAL, theta[:4], strict=True)))
        setting = {p.name: float(v) for p, v in zip(parameters, theta[4:], strict=True)}
        name = other.name if other else ""
        return difference(simulate(driven, name, setting if other else None, rig), measured)

    starts = [np.concatenate([nominal, values]) for values in _starts(other)]
    best = min(starts, key=lambda theta: rms(residual(theta)))
    fit = least_squares(residual, np.clip(best, low, high), bounds=(low, high), x_scale=scale,
                        diff_step=1e-4, max_nfev=20)  # fmt: skip
    return float(2 * fit.cost)


def _starts(other):
    """Return where a fit may begin: typical sizes, the starts of each parameter, and the other sign."""
    if other is None:
        return [[]]
    typical = list(other.typical.values())
    starts = [typical]
    for i, p in enumerate(other.parameters):
        choices = [*p.starts, *([-p.typical] if p.low < 0.0 else [])]
        starts += [[*typical[:i], value, *typical[i + 1 :]] for value in choices]
    return starts
