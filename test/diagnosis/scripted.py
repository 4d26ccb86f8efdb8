"""Scripted fits: the residual of the F/T torque that each set of causes leaves, in place of a simulation.

Search and elimination see candidates, problems and scores as from real fits; a table gives their sizes.
"""

import math
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np

from rsea_ros.diagnosis.candidate import Candidate
from rsea_ros.diagnosis.score import Score
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.solver import Pools, Solution, serial
from rsea_ros.identification.unknowns import Unknown
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig

RIG = load_rig("paper_high_impedance")
POOLS = Pools(SimpleNamespace(map=lambda work, items: [work(i) for i in items]), serial)
BLOCKS, SAMPLES = 40, 100.0


def score(ratio):
    """The score of a residual of the F/T torque that is so many times the noise in every block."""
    return Score({"ft": np.full(BLOCKS, SAMPLES * ratio**2)}, {"ft": np.full(BLOCKS, SAMPLES)})


def unknown(name, doubt=math.inf):
    return Unknown(name, 0.0, "1", -1e9, 1e9, False, doubt, 1.0)


def typical(u):
    """The typical size of a parameter of an effect: within its bounds."""
    effect, _, parameter = u.name.partition(".")
    return effect_named(effect).typical.get(parameter, 0.0)


def problem(*causes, stated=()):
    """A problem whose rig states some effects and has others added."""
    names = (*stated, *causes)
    rig = RIG.with_effects(*(EffectSetting(n, dict(effect_named(n).typical)) for n in names))
    moved = [f"{n}.{p.name}" for n in causes for p in effect_named(n).parameters]
    unknowns = (unknown("prior", doubt=1.0), *map(unknown, moved))
    newest = causes[-1] if causes else ""
    return Problem((), rig, unknowns, ("ft",), stated=frozenset(stated), newest=newest)


@dataclass
class Script:
    """Results of fits. ratio: residual over noise by causes, in any order; prior: its cost.

    log: each fit, as causes, and whether it was quick. cases: of every candidate.
    """

    ratio: dict[frozenset[str], float]
    prior: dict[frozenset[str], float] = field(default_factory=dict)
    cases: tuple = (SimpleNamespace(coloured=frozenset()),)
    log: list = field(default_factory=list)
    setups: list = field(default_factory=list)

    def candidate(self, *causes, stated=(), of=None):
        """Return the candidate with some causes; of: a problem that it was fitted from."""
        made = problem(*causes, stated=stated) if of is None else of
        key = frozenset(made.added)
        theta = np.array([math.sqrt(self.prior.get(key, 0.0)), *map(typical, made.unknowns[1:])])
        solution = Solution(made, theta, np.zeros(1), np.zeros((1, len(theta))), 0.0)
        return Candidate(solution, [{}], score(self.ratio[key]), self.cases)

    def fit(self, setup, problem, theta=None, near=None):
        """Stand in for fit_candidate."""
        self.log.append((problem.added, setup.is_quick))
        self.setups.append((setup, theta))
        return self.candidate(of=problem)


def script(ratios, priors=None, **more):
    """A script from tables whose keys are causes with + between them; "" for none."""

    def key_table(table):
        return {frozenset(filter(None, key.split("+"))): value for key, value in (table or {}).items()}

    return Script(key_table(ratios), key_table(priors), **more)


def settings(max_causes=4, **forward):
    return replace(DEFAULT, max_causes=max_causes, forward=replace(DEFAULT.forward, **forward))
