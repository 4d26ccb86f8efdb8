"""The program inside an FMU: our own compiled step on the rig that lies beside it in the archive.

pythonfmu3 puts this file into the archive and finds the class by its text. The Python that plays the FMU
needs rsea_ros. Inputs are held over a communication step, which may be any whole number of steps of STEP.
"""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from pythonfmu3 import (
    DefaultExperiment,
    Float64,
    Fmi3Causality,
    Fmi3Initial,
    Fmi3Slave,
    Fmi3Status,
    Fmi3StepResult,
    Fmi3Variability,
    Unit,
)

from rsea_ros import Rig, load_rig
from rsea_ros.extension.rigs import effect_named
from rsea_ros.extension.target import OUTPUTS, build, identifier, run

STEP = 1e-4
"""s, of the compiled step."""
DURATION = 60.0
"""s, over which drifts come to their full size unless the player sets another `duration`."""
UNITS = {
    "N m": {"kg": 1, "m": 2, "s": -2},
    "N m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N m s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "kg m^2": {"kg": 1, "m": 2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "s": {"s": 1},
    "Hz": {"s": -1},
}
"""Exponents of the base units; a parameter in another unit has it in its description."""


class RseaActuator(Fmi3Slave):  # type: ignore[misc]
    """One bench. Its parameters are the rig's values and those of its effects."""

    def __init__(self, **kwargs) -> None:  # type: ignore[no-untyped-def]
        super().__init__(**kwargs)
        self._rig: Rig = load_rig(Path(self.resources) / "rig.yaml")
        self.modelName = identifier(self._rig.name)
        self.description = (Path(self.resources) / "coverage.txt").read_text(encoding="utf-8")
        self.default_experiment = DefaultExperiment(start_time=0.0, stop_time=10.0, step_size=1e-3)
        self.register_units([Unit(name, **powers) for name, powers in UNITS.items()])
        self._command, self._at, self._values = 0.0, 0, {"duration": DURATION}
        self._out = np.zeros((1, len(OUTPUTS)))
        driven, unit = ("torque_command", "N m") if self._rig.loop is None else ("desired_position", "rad")
        flows, steps = Fmi3Variability.continuous, Fmi3Variability.discrete
        declared = [
            Float64(
                "time", unit="s", causality=Fmi3Causality.independent, variability=flows,
                getter=lambda: self._at * STEP,
            ),
            Float64(
                driven, unit=unit, description="held over a communication step", start=0.0,
                causality=Fmi3Causality.input, variability=steps,
                getter=partial(getattr, self, "_command"), setter=partial(setattr, self, "_command"),
            ),
        ]  # fmt: skip
        units = {"position": "rad", "velocity": "rad/s", "deflection": "rad"}
        declared += [
            Float64(
                name, unit=units.get(name, "N m"), causality=Fmi3Causality.output, variability=flows,
                initial=Fmi3Initial.calculated, getter=partial(self._output, at),
            )
            for at, name in enumerate(OUTPUTS) if self._rig.measures(name)
        ]  # fmt: skip
        for one in declared:
            self.register_variable(one, nested=False)
        self._parameter("duration", "s", DURATION)
        for name, value in self._rig.values().items():
            self._parameter(name, self._rig.unit(name), value)
        for setting in self._rig.effects:
            effect = effect_named(setting.name)
            for p, value in zip(effect.parameters, effect.vector(setting.parameters), strict=True):
                self._parameter(f"{effect.name}.{p.name}", p.unit, value)

    def _output(self, at: int) -> float:
        return float(self._out[-1, at])

    def _parameter(self, name: str, unit: str, value: float) -> None:
        """Declare a value of the rig or of an effect, unless it is infinite."""
        if np.isfinite(value):
            self._values[name] = float(value)
            known = {"unit": unit} if unit in UNITS else {"description": unit}
            self.register_variable(
                Float64(
                    name, causality=Fmi3Causality.parameter, variability=Fmi3Variability.fixed, **known,
                    getter=partial(self._values.__getitem__, name),
                    setter=partial(self._values.__setitem__, name),
                ),
                nested=False,
            )  # fmt: skip

    def exit_initialization_mode(self) -> None:
        """Make the machine of the parameters that were set."""
        values, sizes = self._rig.values(), {one.name: dict(one.parameters) for one in self._rig.effects}
        for name, value in self._values.items():
            part, _, parameter = name.partition(".")
            if name in values:
                values[name] = value
            elif part in sizes:
                sizes[part][parameter] = value
        settings = [replace(one, parameters=sizes[one.name]) for one in self._rig.effects]
        rig, duration = self._rig.with_values(values).with_effects(*settings), self._values["duration"]
        self._machine = build(rig, STEP, duration, in_loop=rig.loop is not None)
        self._machine.begin()

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        """Hold the input to the end of the communication step."""
        stop = round((current_time + step_size) / STEP)
        if stop > self._at:
            steps = np.full(stop - self._at, self._command)
            self._out = np.empty((len(steps), len(OUTPUTS)))
            zeros = np.zeros(len(steps))
            is_torque = self._rig.loop is None
            run(
                self._machine, steps if is_torque else zeros, self._out, start=self._at * STEP,
                **({} if is_torque else {"reference": steps}),
            )  # fmt: skip
            self._at = stop
        return Fmi3StepResult(status=Fmi3Status.ok)
