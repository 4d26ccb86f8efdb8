"""The responses of all channels to a torque of any course, put into the simulation at one port.

The answer is (simulation with a small torque - simulation without it) / its size, so it holds for every rig
that can be simulated: with other effects acting, in a loop, with free ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rsea_ros.effects import signal_table as st
from rsea_ros.effects.effect import compiled
from rsea_ros.effects.signal_table import Port
from rsea_ros.laws.terms import PORTS, Place
from rsea_ros.model.drive import Drive
from rsea_ros.model.rig import Rig
from rsea_ros.model.sampling import sample
from rsea_ros.model.simulation import Machine, build, run
from rsea_ros.model.step import OUTPUTS, Calls
from rsea_ros.records.record import FloatArray

_SHARE = 1e-3
"""Of the largest command: the torque whose answer is taken; a linear rig answers alike to any."""


@compiled
def _inject(s, p, x):  # type: ignore[no-untyped-def]
    """Add p[1:], one value a step, at the port p[0]; 5 and 6: on the housing's and on the spring's end."""
    at = s[st.TIME] / s[st.STEP]
    if p[0] == 2.0:
        s[st.GEAR_TORQUE] += p[1 + int(at)]
    elif p[0] == 5.0:
        s[st.HOUSING_TORQUE] += p[1 + int(at)]
    elif p[0] == 6.0:
        s[st.DISTAL_TORQUE] += p[1 + int(at)]
    elif p[0] == 3.0:
        k = int(at + 0.5)
        s[st.SPRING_TORQUE] += 0.5 * (p[k] + p[1 + k]) if s[st.COMMIT] == 1.0 else p[1 + int(at)]
    else:
        k = int(at + 0.5)
        s[st.COMMAND] += p[1 + k]
        if p[0] == 0.0:
            s[st.CURRENT] += p[1 + k]


@dataclass(frozen=True)
class Injector:
    """A rig and its drive. sampled: record times of each channel's samples by its clock, s."""

    rig: Rig
    drive: Drive
    sampled: Mapping[str, FloatArray]

    @property
    def middles(self) -> FloatArray:
        """The middle of each step, s since the record's start."""
        return np.asarray(self.drive.step * (np.arange(len(self.drive.command)) + 0.5))

    @cached_property
    def base(self) -> FloatArray:
        """All OUTPUTS at the ends of the steps, the start first, without anything added."""
        return self._run(None, "gear")

    def answers(self, torque: FloatArray, place: Place) -> dict[str, FloatArray]:
        """Return the response of each sampled channel to a torque (N m, one value a step) at a port."""
        largest = float(np.max(np.abs(torque), initial=0.0))
        if largest == 0.0:
            return {n: np.zeros(len(t)) for n, t in self.sampled.items()}
        drive = self.drive
        size = _SHARE * (1.0 if self.rig.loop else float(np.max(np.abs(drive.command), initial=1e-9)))
        out = (self._run(torque * (size / largest), place) - self.base) * (largest / size)
        at = {n: (t - drive.start) / drive.step for n, t in self.sampled.items()}
        kinks = np.zeros(len(drive.command))
        return {n: sample(n, out[:, OUTPUTS.index(n)], at[n], kinks) for n in at}

    def raw(self, torque: FloatArray, place: Place) -> FloatArray:
        """Return the response of all OUTPUTS to a torque (N m) at the ends of the steps, the start first."""
        return self._run(torque, place) - self.base

    def quiet(self) -> Injector:
        """Return the same rig at rest, without commands and without effects: its linear part."""
        drive, rig = self.drive, self.rig
        still = replace(drive, command=np.zeros(len(drive.command)), initial=(0.0, 0.0), restarts=())
        return Injector(rig.with_effects(), still, self.sampled)

    def _run(self, torque: FloatArray | None, place: Place) -> FloatArray:
        drive, rig = self.drive, self.rig
        machine = build(
            rig, drive.step, drive.drift_time, in_loop=len(drive.reference) > 0 or rig.loop is not None
        )
        if torque is not None:
            machine = with_injection(machine, torque, PORTS[place], _kind(rig, place))
        machine.begin(drive.initial)
        out = np.empty((len(drive.command) + 1, len(OUTPUTS)))
        out[0] = machine.table[[st.POSITION, st.VELOCITY, st.COMMAND, st.FT, st.SPRING_ANGLE]]
        command, reference = drive.command, drive.reference
        if rig.loop is not None:
            command, reference = np.zeros(len(drive.command)), drive.command
        run(machine, command, out[1:], reference=reference)
        out[0, 2] = out[1, 2]
        return out


def _kind(rig: Rig, place: Place) -> float:
    if place != "load":
        return float(PORTS[place])
    return 5.0 if rig.end_is_free("housing_end") else 6.0


def with_injection(machine: Machine, torque: FloatArray, port: Port, kind: float) -> Machine:
    """Return a machine to which a torque is added at a port, after the effects that act there."""
    calls, at = machine.calls, int(machine.calls.first[port + 1])
    first = calls.first.copy()
    first[port + 1 :] += 1
    series = np.concatenate([[kind], torque, torque[-1:]])
    changed = Calls(
        first=first,
        address=np.insert(calls.address, at, _inject.address),
        p_at=np.insert(calls.p_at, at, len(calls.p)),
        x_at=np.insert(calls.x_at, at, 0),
        p=np.concatenate([calls.p, series]),
        nonlinear=calls.nonlinear or port in (Port.GEAR, Port.SPRING),
    )
    return replace(machine, calls=changed)
