"""How far two right simulations of one bench differ in fitted parameters: MuJoCo's against ours.

MuJoCo plays the exported model of a rig with one effect, and the rig with that effect is fitted to the play.
Each line shows the fitted over the true value, less 1, of every parameter whose interval by noise reaches no
farther than NARROW. The last line shows their RMS, for `sizes.model_error`. The coverage of intervals is
measured on another bench (`intervals`). MuJoCo needs Python 3.11 or later.
Left out by default are effects that MuJoCo plays by another law that stands in for them: their difference is
that of the laws.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.exports.mjcf import EFFECTS, STRUCTURES, export_mjcf
from rsea_ros.exports.verification import RATE, play_mujoco
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.identification.identify import identify
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

NARROW = 0.003
"""Of a value: a wider interval would show the noise, not the simulations."""
SUBSTITUTED = ("stribeck_friction", "spring_hysteresis", "gravity_error")
"""Played by bristles and by elasto-plastic springs in parallel; the last needs a free end."""
NATIVE = tuple(name for name in (*EFFECTS, *STRUCTURES) if name not in SUBSTITUTED)
BENCH = ExcitationSettings(amplitude=10.0, noise=2.0, low=0.2, high=60.0, seed=3)


def main(
    *, rig: str = "paper_high_impedance", seconds: float = 16.0, effects: tuple[str, ...] = ("", *NATIVE)
) -> Iterator[str]:
    """Print the table and the RMS of all deviations.

    seconds: of each run
    """
    every: list[float] = []
    for name in effects:
        played = load_rig(rig)
        try:
            deviations = dict(deviations_of(played.with_effect(name) if name else played, seconds))
        except RseaError as error:
            yield f"{name or 'nominal':24} {error}"
            continue
        cells = ", ".join(f"{n} {100.0 * d:+.2f} %" for n, d in deviations.items())
        yield f"{name or 'nominal':24} {cells}"
        every += deviations.values()
    median, largest = np.median(np.abs(every)), np.max(np.abs(every))
    yield (f"{len(every)} parameters: RMS {100.0 * np.sqrt(np.mean(np.square(every))):.2f} %, "
           f"median {100.0 * median:.2f} %, largest {100.0 * largest:.2f} %")  # fmt: skip


def deviations_of(rig: Rig, seconds: float) -> Iterator[tuple[str, float]]:
    """Yield name and relative deviation of each parameter that a fit to MuJoCo's play determines.

    Raises ParameterError for an effect that the exported model leaves out.
    """
    for name, why in export_mjcf(rig).leaves_out.items():
        if name in {e.name for e in rig.effects}:
            raise ParameterError(f"left out of the model: {why}")
    of_effects = {f"{e.name}.{n}": v for e in rig.effects for n, v in e.parameters.items()}
    true = {**rig.values(), **of_effects}
    for p in identify([played_record(rig, seconds)], rig).parameters:
        truth = true.get(p.name)
        if truth and p.ci95[1] - p.ci95[0] < 2.0 * NARROW * abs(truth):
            yield p.name, p.value / truth - 1.0


def played_record(rig: Rig, seconds: float) -> Record:
    """Return what the sensors of a rig log of MuJoCo's play of a chirp with noise."""
    command = excitation("chirp", replace(BENCH, rate=RATE, duration=seconds))
    t, rng = np.arange(len(command)) / RATE, np.random.default_rng(1)
    channels = {"command": Channel(t, command)}
    for name, y in play_mujoco(export_mjcf(rig).content, rig, command).items():
        if name in rig.sensors:
            noise = rig.sensors[name].noise
            channels[name] = Channel(t, y + noise * rng.standard_normal(len(y)))
    return Record(channels)
