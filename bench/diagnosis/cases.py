"""Records with a known cause, for measuring the diagnosis: made by the second bench, not by the model.

`plan(seed)` lists the cases; `Plan.make()` simulates one case, so that a run needs only one in memory.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from itertools import permutations

import numpy as np
from independent.bench import Bench, drawn_bench, record_run
from independent.faults import FAULTS
from independent.hidden import (
    BESIDE_THE_CONTRACT,
    CATALOGUE,
    OFF_CATALOGUE,
    hide,
    hide_beside_the_contract,
    hide_off_catalogue,
)
from independent.severities import SEVERITIES, SIZES, drawn_parameters

from bench import SHARED
from bench.diagnosis.played import Entry, Played
from msg_adapters import read_record
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.rig_file import load_rig

RIG = "paper_high_impedance"
RIG_VALUES = {
    "rotor.reflected_inertia": "j_m", "rotor.reflected_damping": "b_m",
    "spring.stiffness": "k_s", "spring.damping": "b_s",
}  # fmt: skip
"""Value of the rig, and its name on the second bench."""
FOLDER = SHARED / "cases"
"""Bags from a plant outside this repository, with their truth beside them."""
IN_TRUTH = {
    ("coulomb_friction", "torque"): "coulomb", ("backlash", "gap"): "backlash",
    ("structural_resonance", "frequency"): "par_f", ("structural_resonance", "damping_ratio"): "par_zeta",
    ("structural_resonance", "participation"): "par_mass", ("command_delay", "delay"): "delay",
    ("nonlinear_spring", "cubic"): "k_cubic", ("torque_constant_error", "gain"): "torque_gain",
    ("mains_interference", "amplitude"): "hum", ("mains_interference", "frequency"): "hum_f",
    ("damping_drift", "relative_change"): "damp_drift",
}  # fmt: skip
"""Parameters that have another name in the truth file of the shared cases."""
PAIRS = tuple((one, other) for one, others in {
    "coulomb_friction": ("structural_resonance", "backlash", "command_delay", "nonlinear_spring",
                         "torque_ripple", "ft_drift", "mains_interference", "stiffness_drift"),
    "backlash": ("structural_resonance", "current_loop_lag", "ft_bias"),
    "nonlinear_spring": ("command_delay", "mains_interference", "damping_drift"),
    "torque_constant_error": ("structural_resonance", "command_delay"),
    "torque_saturation": ("ft_bias", "structural_resonance"),
    "load_dependent_friction": ("mains_interference", "current_loop_lag"),
    "asymmetric_friction": ("structural_resonance",), "torque_ripple": ("ft_sensor_lag",),
    "hard_stop": ("ft_drift",), "damping_drift": ("structural_resonance",),
}.items() for other in others)  # fmt: skip
"""Two effects that different parts of the data show."""

READINGS = (
    ("asymmetric_friction", {"offset": 1.5}, {"friction_offset": 0.0, "one_sided": 1.5}),
    ("spring_hysteresis", {"torque": 1.2, "angle": 2.5e-3}, {"bouc_wen_beta": 0.5}),
    ("backlash", {"gap": 2.0e-3}, {"encoder_on_chassis": 1.0}),
    ("gear_compliance", {"stiffness": 2.2e3}, {"encoder_on_chassis": 0.0}),
    (
        "torque_ripple",
        {"amplitude": 1.2, "cycles_per_revolution": 2.0 * np.pi / (502 * 0.011), "phase": 0.0},
        {"ripple": 0.0, "cogging": 1.2, "cogging_period": 0.011},  # a wave of the output angle: the same law
    ),
)
"""Effect, its size, and values of the bench that stand for another reading of its definition."""


def hide_all(
    bench: Bench, effects: Mapping[str, Mapping[str, float]], off: tuple[str, float] | None = None
) -> Bench:
    """Return a bench with effects of the catalogue and a law outside it (name, relative size)."""
    for effect, parameters in effects.items():
        if parameters.keys() <= CATALOGUE.get(effect, {}).keys():
            bench = hide(bench, effect, parameters)
        else:
            main = next(iter(parameters))
            factor = parameters[main] / BESIDE_THE_CONTRACT[effect][0][main]
            bench = hide_beside_the_contract(bench, effect, factor)
    return hide_off_catalogue(bench, *off) if off else bench


def newer_parameters(effect: str, factor: float) -> dict[str, float]:
    """Return the parameters of an effect that came after the first 23, its medium size times a factor."""
    parameters, _ = BESIDE_THE_CONTRACT[effect]
    main = next(iter(parameters))
    return {**parameters, main: parameters[main] * factor}


def kin_of(name: str) -> tuple[str, ...]:
    """Return an effect with all that are confused with it."""
    effects = catalogue()
    alike = [n for n, e in effects.items() if name in e.claims.confusable_with]
    return (name, *dict.fromkeys([*effects[name].claims.confusable_with, *alike]))


@dataclass(frozen=True)
class Plan:
    """The ingredients of a case; without: effects that the diagnosis may not use.

    group: single, pair, clean, off_catalogue, taken_out, faulty, reading, drawn_pair, drawn_triple, newer, or
    unsearched (an effect that a diagnosis does not try unless a rig states it).
    """

    name: str
    group: str
    seed: int
    excitation: str = "chirp_noise"
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    values: Mapping[str, float] = field(default_factory=dict)
    off: tuple[str, float] | None = None
    faults: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    duration: float = 60.0

    def make(self, fresh: bool = True, duration: float | None = None) -> Played:
        """Simulate the case: its record with the faults put in, and a fresh record without.

        fresh: with that one. duration: of each, s, in place of the plan's.
        """
        plain, seconds = drawn_bench(np.random.default_rng(self.seed)), duration or self.duration
        bench = hide_all(plain, self.hidden, self.off).with_values(**self.values)
        record = record_run(bench, self.seed + 1, self.excitation, seconds)
        again = record_run(bench, self.seed + 2, self.excitation, seconds) if fresh else None
        rng = np.random.default_rng(self.seed + 3)
        for fault in self.faults:
            record = FAULTS[fault](record, rng)
        about = {"group": self.group, "faults": self.faults}
        about |= {"mimics": OFF_CATALOGUE[self.off[0]][1]} if self.off else {}
        values = {name: getattr(plain.plant, alias) for name, alias in RIG_VALUES.items()}
        truth = (self.without, tuple(self.hidden), self.hidden, values)
        return Played(record, load_rig(RIG), *truth, fresh=again, about=about)


def plan(seed: int = 2024) -> tuple[Plan, ...]:
    """Return all cases that a seed makes, each with a seed of its own."""
    makers = (_singles, _pairs, _clean, _off_catalogue, _faulty, _readings, _taken_out, _draw, _newer)
    rng = np.random.default_rng(seed)
    return tuple(case for maker in makers for case in maker(rng))


def _excitation(k: int) -> str:
    return ("chirp_noise", "multisine")[k % 2]


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(1, 2**31)) * 8


def _singles(rng: np.random.Generator) -> Iterator[Plan]:
    for effect in SIZES:
        for severity in SEVERITIES:
            for excitation in ("chirp_noise", "multisine"):
                hidden = {effect: drawn_parameters(effect, severity, rng)}
                name = f"{effect}-{severity}-{excitation}"
                yield Plan(name, "single", _seed(rng), excitation, hidden)


def _pairs(rng: np.random.Generator) -> Iterator[Plan]:
    for k, pair in enumerate(PAIRS):
        severity = SEVERITIES[1 + k % 2]
        hidden = {effect: drawn_parameters(effect, severity, rng) for effect in pair}
        yield Plan("+".join(pair), "pair", _seed(rng), _excitation(k // 2), hidden)


def _clean(rng: np.random.Generator) -> Iterator[Plan]:
    for k in range(24):
        yield Plan(f"clean-{k:02d}", "clean", _seed(rng), _excitation(k))


def _off_catalogue(rng: np.random.Generator) -> Iterator[Plan]:
    for k, effect in enumerate(OFF_CATALOGUE):
        for factor in (0.7, 1.4):
            off = (effect, factor * rng.uniform(0.9, 1.1))
            yield Plan(f"off-{effect}-{factor}", "off_catalogue", _seed(rng), _excitation(k), off=off)


def _taken_out(rng: np.random.Generator) -> Iterator[Plan]:
    """Every effect hidden, and taken out of the catalogue with all effects that are confused with it."""
    for k, name in enumerate(catalogue()):
        if name in SIZES:
            hidden = {name: drawn_parameters(name, "medium", rng)}
            seed = _seed(rng)
            yield Plan(f"taken_out-{name}", "taken_out", seed, _excitation(k), hidden, without=kin_of(name))


def _faulty(rng: np.random.Generator) -> Iterator[Plan]:
    """Every fault on a healthy bench, and on a bench with an effect that must be named in spite of it."""
    for k, fault in enumerate(FAULTS):
        yield Plan(f"fault-{fault}", "faulty", _seed(rng), _excitation(k), faults=(fault,))
        if fault != "missing_topic":
            hidden = {"coulomb_friction": drawn_parameters("coulomb_friction", "medium", rng)}
            name = f"fault-{fault}-coulomb_friction"
            yield Plan(name, "faulty", _seed(rng), _excitation(k), hidden, faults=(fault,))


def _draw(rng: np.random.Generator) -> Iterator[Plan]:
    """Two or three effects drawn at random, of those that are not confused with each other."""
    effects, names = catalogue(), list(SIZES)
    for group, count, number in (("drawn_pair", 2, 50), ("drawn_triple", 3, 25)):
        drawn = 0
        while drawn < number:
            chosen = [str(n) for n in rng.choice(names, count, replace=False)]
            if any(b in effects[a].claims.confusable_with for a, b in permutations(chosen, 2)):
                continue
            drawn += 1
            severity = SEVERITIES[1 + int(rng.integers(2))]
            hidden = {effect: drawn_parameters(effect, severity, rng) for effect in chosen}
            name = f"{'+'.join(chosen)}-{severity}"
            yield Plan(name, group, _seed(rng), _excitation(int(rng.integers(2))), hidden)


def _newer(rng: np.random.Generator) -> Iterator[Plan]:
    """The effects that came after the first 23, at half, full and twice the medium size; drawn last, so that
    the seeds of all other cases stay."""
    for effect in BESIDE_THE_CONTRACT:
        for k, factor in enumerate((0.5, 1.0, 2.0)):
            name = f"newer-{effect}-{factor:g}"
            group = "newer" if catalogue()[effect].is_searched else "unsearched"
            yield Plan(name, group, _seed(rng), _excitation(k), {effect: newer_parameters(effect, factor)})


def _readings(rng: np.random.Generator) -> Iterator[Plan]:
    """Other readings of the definitions of effects; no limits hold for these, but the matrix shows them."""
    for effect, parameters, values in READINGS:
        for excitation in ("chirp_noise", "multisine"):
            name = f"reading-{effect}-{excitation}"
            yield Plan(name, "reading", _seed(rng), excitation, {effect: parameters}, values)


def shared_records() -> Iterator[Entry]:
    """Yield the shared cases by their number, none where the folder is not there."""
    for folder in sorted(FOLDER.glob("[0-9]*")):
        yield Entry(f"shared-{folder.name}", partial(_shared, folder.name))


def _shared(number: str) -> Played:
    """Return a shared case; no second bag of the same bench exists for it."""
    entry = json.loads((FOLDER / "truth" / "truth.json").read_text())[number]
    causes = tuple(entry["causes"])
    names = {c: {n: IN_TRUTH.get((c, n), n) for n in CATALOGUE[c]} for c in causes}
    sizes = {
        c: {n: entry["bench"][alias] for n, alias in aliases.items() if alias in entry["bench"]}
        for c, aliases in names.items()
    }
    about = {"group": ("clean", "single", "pair")[min(len(causes), 2)]}
    return Played(read_record(FOLDER / number), load_rig(RIG), (), causes, sizes, about=about)
