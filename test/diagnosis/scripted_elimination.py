"""Backward elimination on scripted fits: no screening, no initial guess is computed."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import scripted
from scripted import POOLS, Script

from rsea_ros.diagnosis import backward_elimination as elimination
from rsea_ros.diagnosis.backward_elimination import ReducedModels, eliminate_backwards
from rsea_ros.diagnosis.evaluation import Selection
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import effect_named


class World:
    """Rivals and their fits from a script. guesses: by rival. impossible: rivals that the rig cannot have."""

    def __init__(self, monkeypatch, fits: Script, *effects):
        self.fits, self.guesses, self.impossible = fits, {}, set()
        self.models = ReducedModels([effect_named(n) for n in effects], POOLS, DEFAULT)
        monkeypatch.setattr(elimination, "fit_candidate", fits.fit)
        monkeypatch.setattr(elimination, "apply", lambda rig, unknowns, theta: (rig, None))
        monkeypatch.setattr(elimination, "RecordView", lambda case, rig, outputs: (case, rig, outputs))
        monkeypatch.setattr(elimination, "initial_guesses", lambda effect, view: [{"from": "residual"}])
        monkeypatch.setattr(elimination, "screen", self.screen)

    def screen(self, solution, rival, guesses, rule):
        assert rule is DEFAULT.forward
        self.guesses[rival.name] = guesses
        if rival.name in self.impossible:
            return None
        made = scripted.problem(*solution.problem.added, rival.name)
        return SimpleNamespace(problem=made, theta=np.zeros(len(made.unknowns)))

    def eliminate(self, *causes):
        """Return the selection that is left of some causes."""
        selection = Selection((self.fits.candidate(), self.fits.candidate(*causes)))
        return eliminate_backwards(selection, self.models.effects, POOLS, DEFAULT)
