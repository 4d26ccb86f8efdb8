"""Rates shapes: scales them to the limits and simulates the prediction of each hypothesis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from rsea_ros.experiment.hypothesis import Hypothesis, Response, motion, noise_of, response, run_case
from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.run_limits import largest_share, of_command, of_response
from rsea_ros.experiment.run_shape import Shape, command_of
from rsea_ros.identification.problem import Case
from rsea_ros.identification.solver import Map
from rsea_ros.records.record import MEASURED, FloatArray

INSIDE = 0.9
"""Share of the limits that shapes use during the search, where only the likeliest values are simulated."""


@dataclass(frozen=True)
class ShapeRater:
    """Rates shapes for hypotheses. noise: by channel."""

    hypotheses: Sequence[Hypothesis]
    asked: DesignRequest
    noise: Mapping[str, float]
    run: Map

    def within(self, shape: Shape, duration: float) -> FloatArray:
        """Return the command of a shape in shares, as large as the limits allow at the likeliest values."""
        limits, rate = self.asked.limits, self.asked.rate
        whole = abs(shape.bias) + shape.amplitude
        size = limits.torque * min(1.0, 1.0 / whole) * INSIDE
        scaled = replace(shape, amplitude=shape.amplitude * size, bias=shape.bias * size)
        command = command_of(scaled, duration, rate, limits.slew)
        for _ in range(3):
            share = max(self.share(h, command) for h in self.hypotheses)
            if share <= INSIDE * 1.05:
                break
            command = command * (INSIDE / share if math.isfinite(share) else 0.5)
        return command

    def share(self, hypothesis: Hypothesis, command: FloatArray) -> float:
        """Return the share of the limits that a command uses at the likeliest values."""
        rate = self.asked.rate
        rig = hypothesis.rig_at(hypothesis.if_there())
        peaks = of_response(command, motion(rig, command, rate)) | of_command(command, rate)
        return largest_share(peaks, self.asked.limits)

    def responses(self, command: FloatArray, *, is_quick: bool = True) -> list[Response]:
        """Return the prediction of each hypothesis for a command."""
        case = self.case(command, is_quick=is_quick)
        return [response(h, case, self.run) for h in self.hypotheses]

    def case(self, command: FloatArray, *, is_quick: bool) -> Case:
        """Return a run of a command, not yet made."""
        return run_case(command, self.asked.rate, self.noise, is_quick=is_quick)


def noise_by_channel(hypotheses: Sequence[Hypothesis], measured: Mapping[str, float]) -> dict[str, float]:
    """Return the noise of every channel that the bench measures."""
    rig = hypotheses[0].problem.rig
    listed = [n for n in MEASURED if n in (measured or rig.sensors) and rig.measures(n)]
    return {n: noise_of(rig, n, measured) for n in listed or ["ft", "position"]}
