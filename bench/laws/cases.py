"""Records whose cause is hidden from the search for a law: effects of the catalogue, and laws it never had.

Each case has two records of one bench, with other noise and another excitation: one to learn from, one that
only judges. Catalogue effects and the laws written here are simulated by the step, on a bench whose values
are not the rig's; the others by the second bench of the tests, which shares no code with the model.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from independent.bench import drawn_bench, record_run
from independent.excitations import chirp_noise, odd_multisine
from independent.hidden import BESIDE_THE_CONTRACT, hide_beside_the_contract

from rsea_ros.effects import signal_table as st
from rsea_ros.effects.catalogue import catalogue, lend
from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import Port
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record

RATE = 280.0
RIG, FREE = "paper_high_impedance", "paper_moving_output"
_CLAIMS = Claims("velocity", "neither", None)


@dataclass(frozen=True)
class LawCase:
    """A hidden law. effect: the true effect, fitted for comparison. right: the right regressors.

    second: whether the second bench plays it.
    """

    name: str
    group: str
    effect: Effect | None
    parameters: Mapping[str, float]
    right: tuple[str, ...]
    rig: str = RIG
    second: bool = False
    seed: int = 1

    def records(self, duration: float) -> tuple[Record, Record]:
        """Return a record to learn from and one that judges."""
        seeds = (10 * self.seed, 10 * self.seed + 1)
        if self.second:
            bench = drawn_bench(np.random.default_rng(self.seed))
            bench = hide_beside_the_contract(bench, self.effect.name) if self.effect else bench
            kinds = zip(seeds, ("chirp_noise", "multisine"), strict=True)
            first, second = (record_run(bench, seed, kind, duration) for seed, kind in kinds)
            return first, second
        effects = (self.effect,) if self.effect else ()
        rig = _move(load_rig(self.rig), self.seed)
        rig = rig.with_effects(*(EffectSetting(e.name, dict(self.parameters)) for e in effects))
        made = []
        with lend(*effects):
            for k, excitation in enumerate((chirp_noise, odd_multisine)):
                command = excitation(duration, np.random.default_rng([self.seed, k]))
                channel = Channel(np.arange(len(command)) / RATE, command)
                made.append(synthesize(rig, channel, seed=seeds[k]))
        return made[0], made[1]


def _move(rig: Rig, seed: int) -> Rig:
    """Return a rig whose inertia, damping and stiffness differ from its file."""
    rng = np.random.default_rng(seed)
    spans = {"rotor.reflected_inertia": 0.15, "rotor.reflected_damping": 0.1, "spring.stiffness": 0.03}
    return rig.with_values({n: rig[n] * float(rng.uniform(1 - s, 1 + s)) for n, s in spans.items()})


RIGHT: Mapping[str, tuple[str, ...]] = {
    "asymmetric_friction": ("a constant", "speed"),
    "backlash": ("the load, at the encoder", "deflection's past", "deflection"),
    "base_compliance": ("the load, at the encoder", "deflection's past"),
    "command_delay": ("command's past",),
    "coulomb_friction": ("speed",),
    "current_loop_lag": ("command's past",),
    "current_loop_overshoot": ("command's past",),
    "damping_drift": ("speed and time",),
    "dead_zone": ("command",),
    "directional_load_friction": ("speed and load", "speed and command"),
    "encoder_delay": ("command's past",),
    "encoder_eccentricity": ("position, periodic, at the encoder",),
    "ft_bias": ("a constant, at the sensor",),
    "ft_delay": ("the sensor's past",),
    "ft_drift": ("time, at the sensor",),
    "ft_gain_error": ("the sensor's torque", "command"),
    "ft_sensor_lag": ("the sensor's past",),
    "gear_compliance": ("the load, at the encoder", "command's past"),
    "gravity_error": ("the load's angle", "position"),
    "hard_stop": ("deflection",),
    "gear_loss": ("speed and command",),
    "load_dependent_friction": ("speed and load",),
    "lopsided_spring": ("deflection",),
    "lugre_friction": ("speed", "position's past"),
    "mains_interference": ("time, periodic, at the sensor",),
    "nonlinear_spring": ("deflection",),
    "quadratic_drag": ("speed",),
    "spring_hysteresis": ("deflection's past",),
    "stiffness_drift": ("deflection and time",),
    "stribeck_friction": ("speed",),
    "structural_resonance": ("the sensor's past",),
    "torque_constant_drift": ("command and time",),
    "torque_constant_error": ("command", "the sensor's torque"),
    "torque_ripple": ("position, periodic",),
    "torque_saturation": ("command",),
    "voltage_sag": ("command and speed", "command"),
}
"""The regressors that are right for each effect, those of one that it may be confused with too."""


@compiled
def _periodic(s, p, x):  # type: ignore[no-untyped-def]
    s[st.SPRING_TORQUE] += p[0] * s[st.DEFLECTION] * math.sin(p[1] * s[st.DEFLECTION])


@compiled
def _one_sided(s, p, x):  # type: ignore[no-untyped-def]
    w = max(s[st.GEAR_VELOCITY], 0.0)
    s[st.GEAR_TORQUE] -= p[0] * w * w


@compiled
def _soft(s, p, x):  # type: ignore[no-untyped-def]
    s[st.COMMAND] = p[0] * math.tanh(s[st.COMMAND] / p[0])


@compiled
def _warm(s, p, x):  # type: ignore[no-untyped-def]
    x[0] += (s[st.COMMAND] * s[st.COMMAND] - x[0]) * s[st.STEP] / p[1]
    s[st.COMMAND] *= 1.0 - p[0] * x[0]


@compiled
def _cable(s, p, x):  # type: ignore[no-untyped-def]
    way = s[st.GEAR_ANGLE] - x[1]
    side = math.copysign(1.0, way)
    x[0] = side + (x[0] - side) * math.exp(-abs(way) / p[1])
    x[1] = s[st.GEAR_ANGLE]
    s[st.GEAR_TORQUE] -= p[0] * x[0] + p[2] * s[st.GEAR_ANGLE] * s[st.GEAR_ANGLE]


def _effect(name: str, port: Port, function: object, reads: tuple[int, ...], states: int,
            **sizes: tuple[str, float]) -> Effect:  # fmt: skip
    parameters = tuple(
        Parameter(n, unit, 0.0 if k == 0 else v, v / 20.0, 20.0 * v, v, logarithmic=k > 0)
        for k, (n, (unit, v)) in enumerate(sizes.items())
    )
    return Effect(
        name, port, parameters, _CLAIMS, function, states=states, reads=reads, equation=" ".join(sizes)
    )


WRITTEN = (
    (_effect("periodic_stiffness", Port.SPRING, _periodic, (st.DEFLECTION,), 0,
             change=("N m/rad", 300.0), wave=("1/rad", 900.0)),
     ("deflection and position, periodic",)),
    (_effect("one_sided_drag", Port.GEAR, _one_sided, (st.GEAR_VELOCITY,), 0,
             coefficient=("N m s^2/rad^2", 20.0)),
     ("speed",)),
    (_effect("soft_saturation", Port.MOTOR, _soft, (), 0, limit=("N m", 40.0)), ("command",)),
    (_effect("warming_motor", Port.MOTOR, _warm, (), 1, loss=("1/(N m)^2", 6e-4), heating_time=("s", 8.0)),
     ("command and temperature",)),
    (_effect("cable_drag", Port.GEAR, _cable, (st.GEAR_ANGLE,), 2, torque=("N m", 1.5), angle=("rad", 1e-3),
             bend=("N m/rad^2", 3000.0)),
     ("position's past", "position")),
)  # fmt: skip
"""Laws that no file of the catalogue has: the effect, and the regressors that are right."""

OUTSIDE = {"dead_band": "dead_zone", "lugre": "lugre_friction", "eccentric_encoder": "encoder_eccentricity"}
"""Laws that the second bench plays: the catalogue's effect that comes nearest."""


def cases(clean: int) -> list[LawCase]:
    """Return all cases. clean: how many benches without anything hidden."""
    made = []
    for k, (name, effect) in enumerate(catalogue().items()):
        if name in RIGHT:
            rig = FREE if name == "gravity_error" else RIG
            made.append(LawCase(name, "catalogue", effect, effect.typical, RIGHT[name], rig, seed=11 + k))
    made += [
        LawCase(e.name, "unknown", e, e.typical, right, seed=71 + k) for k, (e, right) in enumerate(WRITTEN)
    ]
    for k, (name, near) in enumerate(OUTSIDE.items()):
        effect, (known, _) = catalogue()[near], BESIDE_THE_CONTRACT[near]
        sizes = {p.name: known.get(p.name, 0.0) for p in effect.parameters}
        made.append(LawCase(name, "unknown", effect, sizes, RIGHT[near], RIG, True, 91 + k))
    for k in range(clean):
        made.append(LawCase(f"clean-{k}", "clean", None, {}, (), RIG, k % 2 == 0, 200 + k))
    return made
