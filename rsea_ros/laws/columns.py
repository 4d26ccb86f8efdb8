"""The change of all measurements by a law's torque, as rows of a fit: one column for each term."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rsea_ros.diagnosis.data_split import blocks_of, set_of
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.identification.problem import Case, Problem
from rsea_ros.identification.solver import jacobian
from rsea_ros.identification.unknowns import apply
from rsea_ros.laws.injection import Injector, MissingTorque, missing_torque
from rsea_ros.laws.terms import PORTS, Place
from rsea_ros.laws.variables import Variables, variables_along, variables_of
from rsea_ros.model.inverse import Motion, smooth
from rsea_ros.records.record import FloatArray, IntArray

GROUPS = 8
"""Groups of neighbouring blocks of each set, between which the spread of a gain is seen."""


@dataclass(frozen=True)
class CaseModel:
    """One case with its base model: missing torque, variables of a law, and the responses to a torque.

    residual: measured less simulated by channel, zero where masked.
    """

    case: Case
    residual: Mapping[str, FloatArray]
    missing: MissingTorque
    variables: Variables
    injector: Injector | None

    @property
    def places(self) -> tuple[Place, ...]:
        """Where a law may act on this machine."""
        if self.injector is None:
            return ("gear",)
        rig, measured = self.injector.rig, self.case.measured
        can = {
            "gear": True,
            "motor": rig.loop is None,
            "command": rig.loop is None and "motor_torque" in measured,
            "spring": not rig.rigid_spring and rig.ft_end == "spring_end",
            "load": len(rig.clamped) == 1 and rig.loop is None,
            "ft": "ft" in measured,
            "encoder": "position" in measured and not rig.rigid_spring,
        }
        return tuple(place for place in PORTS if can[place])

    def answers(self, values: FloatArray, place: Place) -> dict[str, FloatArray]:
        """Return the response of each measured channel to values along the steps, acting at a place."""
        case = self.case
        if self.injector is None:
            return {"motor_torque": -smooth(values, self.variables.step)}
        if place not in ("ft", "encoder"):
            return self.injector.answers(values, place)
        made = {n: np.zeros(len(t)) for n, t in case.t.items()}
        at = self.injector.drive.start + self.injector.middles
        if place == "ft":
            made["ft"] = np.interp(case.t["ft"], at, values)
        else:
            made["position"] = np.interp(case.t["position"], at, values)
            if "velocity" in case.t:
                made["velocity"] = np.interp(case.t["velocity"], at, np.gradient(values, self.variables.step))
        return made


def case_model(
    problem: Problem, theta: FloatArray, case: Case, outputs: Mapping[str, FloatArray], place: Place = "gear"
) -> CaseModel:
    """Return a case with its base model at theta.

    outputs: simulated channels. place: of the missing torque.
    """
    rig, clocks = apply(problem.rig, problem.unknowns, theta)
    residual = {n: np.where(case.mask[n], case.measured[n] - outputs[n], 0.0) for n in case.measured}
    if isinstance(case.drive, Motion):
        t = case.drive.t - case.drive.t[0]
        torque = -residual["motor_torque"]
        missing = MissingTorque(t, torque, case.noise["motor_torque"], {})
        return CaseModel(case, residual, missing, variables_along(rig, case.drive), None)
    since = {n: t - case.start for n, t in case.t.items()}
    sampled = {n: t + clocks.later(n, since[n]) + rig.clock(n, since[n]) for n, t in case.t.items()}
    injector = Injector(rig, case.drive, sampled)
    channel = "position" if "position" in case.t else next(iter(case.t))
    period = float(np.median(np.diff(case.t[channel])))
    motion = missing_torque(case, residual, injector, period)
    missing = motion if place == "gear" else missing_torque(case, residual, injector, period, place)
    return CaseModel(case, residual, missing, variables_of(injector, motion), injector)


@dataclass(frozen=True)
class ResidualRows:
    """All residuals of a base model, measured less simulated over the noise, shape (m,), and how they group.

    group: set of the block times GROUPS plus a number. channel: number of the channel in `channels`.
    """

    residual: FloatArray
    nominal: FloatArray
    prior: FloatArray
    group: IntArray
    channel: IntArray
    channels: tuple[str, ...]
    masks: tuple[tuple[int, str], ...]
    problem: Problem

    def column(self, answers: Sequence[Mapping[str, FloatArray]]) -> FloatArray:
        """Return answers, one mapping a case, as a column of these rows."""
        cases = self.problem.cases
        return np.concatenate([(answers[i][n] / cases[i].noise[n])[cases[i].mask[n]] for i, n in self.masks])

    @cached_property
    def parts(self) -> dict[tuple[int, int], IntArray]:
        """Rows of each group and channel."""
        key = self.group * len(self.channels) + self.channel
        order = np.argsort(key, kind="stable")
        cuts = np.flatnonzero(np.diff(key[order])) + 1
        pieces = np.split(order, cuts)
        return {(int(self.group[p[0]]), int(self.channel[p[0]])): p for p in pieces}


def rows_of(problem: Problem, theta: FloatArray) -> ResidualRows:
    """Return the rows of a base model. problem: on all samples of its cases."""
    residual = problem.residual(theta)
    masks = tuple((i, n) for i, case in enumerate(problem.cases) for n in problem.present(case))
    groups = []
    for i, n in masks:
        case = problem.cases[i]
        block = blocks_of(case, n, DEFAULT.blocks)[case.mask[n]]
        count = max(int(block.max(initial=0)) + 1, 1)
        groups.append(set_of(block) * GROUPS + np.minimum(block * GROUPS // count, GROUPS - 1))
    sizes = [int(np.count_nonzero(problem.cases[i].mask[n])) for i, n in masks]
    names = tuple(dict.fromkeys(n for _, n in masks))
    which = np.concatenate([np.full(k, names.index(n)) for k, (_, n) in zip(sizes, masks, strict=True)])
    return ResidualRows(
        residual=-residual,
        nominal=jacobian(problem, theta, residual),
        prior=np.array([1.0 / u.reach for u in problem.unknowns]),
        group=np.concatenate(groups),
        channel=which,
        channels=names,
        masks=masks,
        problem=problem,
    )
