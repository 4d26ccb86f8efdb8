"""Remarks of a fit or a diagnosis beside its numbers, as facts (worded by report/remark_words.py)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Code = Literal[
    "even_clocks",
    "clocks_taken_as_right",
    "torque_by_motor_constant",
    "torque_by_loop_gains",
    "at_bound",
    "not_shown",
    "only_prior",
    "only_ratios",
    "only_together",
    "play_undetermined",
    "also_in_model",
    "coherence_lost",
    "on_measured_angle",
    "coloured_noise",
    "off_rig",
    "stretches",
    "lost_cycles",
]
"""What a remark says.

even_clocks: stamps of channels scatter (s RMS) about an even clock, which is used.
clocks_taken_as_right: where the data ask for no correction; were they unknown, the interval of a value would
be so many times as wide.
torque_by_…: nothing but that says how large the torques are.
at_bound: a value ran to its bound (value, unit).
not_shown, only_prior: a value is not identifiable; the data do not show it, or only the rig's prior holds it.
only_ratios, only_together: values that are not identifiable each.
play_undetermined: of a gear, by its best gap (rad) and the gain of that.
also_in_model: effects that the extended model has and that are no causes.
coherence_lost: of a channel with the command, above a frequency (Hz).
on_measured_angle: an effect was simulated on the measured rotor angle.
coloured_noise: of channels, taken from the residual.
off_rig: the rig states a value, the data another (that, 95 % interval), so many of its stated spreads away.
stretches: of long records so many s were used, of so many.
lost_cycles: so many cycles of the driver were lost, and the motor torque shows them.
"""


@dataclass(frozen=True)
class Remark:
    """A fact: its code, the parameters, channels or effects concerned, and its numbers."""

    code: Code
    names: tuple[str, ...] = ()
    values: tuple[float, ...] = ()
    unit: str = ""
