"""Initial guesses: the parameters from which a fit of an effect begins, estimated from the residual.

An effect's file states its guesses. What several effects share is here: lines of a spectrum, limits of the
torque, and compliant parts between rotor and spring.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

STIFFNESS = "spring.stiffness"
_INERTIA, _DAMPING = "rotor.reflected_inertia", "rotor.reflected_damping"

Guess = dict[str, float]
"""Parameters of an effect by name, and values of the rig (`spring.stiffness`) that go with them, SI."""


class ResidualView(Protocol):
    """A record beside the model fitted so far (made by diagnosis/initial_guess.py), SI."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the simulated channels."""

    @property
    def measured(self) -> frozenset[str]:
        """Names of the measured channels."""

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the rig's values that a fit may move."""

    @property
    def rigid_spring(self) -> bool:
        """Whether the rig has no spring."""

    @property
    def is_joint(self) -> bool:
        """Whether positions command the machine."""

    def value(self, name: str) -> float:
        """Return a value of the rig as fitted so far."""

    def is_well_known(self, name: str) -> bool:
        """Return whether a value of the rig is known well beforehand."""

    def travel(self) -> float | None:
        """Return how far the measured position goes, rad; None without that channel."""

    def largest_command(self) -> float | None:
        """Return the largest commanded torque, N m; None for a record of a measured motion."""

    def largest_motor_torque(self) -> float | None:
        """Return the largest measured motor torque but for outliers, N m; None without that channel."""

    def largest_unanswered_command(self, share: float) -> float | None:
        """Return the largest command of which the measured motor torque shows less than a share, N m."""

    def gain(self, channel: str) -> float | None:
        """Return the factor that brings the simulated channel nearest to the measured one; None without."""

    def lines(self, channel: str, is_sharp: bool) -> list[float]:
        """Return the highest peaks of a residual's spectrum, Hz. is_sharp: as sharp as the record is long."""

    def sine(self, channel: str, frequency: float) -> Guess:
        """Return amplitude and phase (rad) of the sine of a frequency (Hz) in a residual."""

    def repeating_torque(self) -> list[Guess]:
        """Return cycles per revolution, amplitude (N m), phase (rad) of the torque that follows the rotor."""

    def repeating_angle(self) -> list[Guess]:
        """Return the same of the measured angle's error, amplitude in rad."""


Guesses = Callable[[Sequence[Guess], ResidualView], list[Guess]]
"""Makes guesses of the default ones, the typical parameters first, and of what the residual shows."""


def at_lines(channel: str, frequency: str = "frequency", sine: Sequence[str] = ()) -> Guesses:
    """Return guesses at the peaks of a channel's spectrum. sine: parameters that amplitude and phase set.

    A mode above all that the command excites makes no peak, so its typical parameters are tried as well.
    """

    def guesses(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
        shown = channel if channel in view.channels else view.channels[0]
        at_peaks = []
        for f in view.lines(shown, is_sharp="amplitude" in sine):
            fitted = view.sine(shown, f) if sine else {}
            at_peaks.append({**defaults[0], frequency: f, **{n: fitted[n] for n in sine}})
        return at_peaks if sine and at_peaks else [*at_peaks, defaults[0]]

    return guesses


_LIMITS = (0.95, 0.85, 0.7, 0.5)
"""Of the largest command or travel: limits below it that still leave most of the run."""


def at_limits(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Return guesses at the largest measured torque, and at shares of the commanded one."""
    commanded = view.largest_command()
    if commanded is None:
        return list(defaults)
    limits = [share * commanded for share in _LIMITS]
    measured = view.largest_motor_torque()
    if measured is not None:
        limits.insert(0, measured)
    return [{**defaults[0], "limit": limit} for limit in limits]


def at_ends_of_travel(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Return guesses at shares of the largest angle that the record shows."""
    travel = view.travel()
    ends = [] if travel is None else [{**defaults[0], "angle": 0.5 * share * travel} for share in _LIMITS]
    return ends or beside_softer_rotor(defaults, view)


def beside_softer_rotor(defaults: Sequence[Guess], view: ResidualView) -> list[Guess]:
    """Return guesses with less inertia and damping, for a compliance between rotor and spring.

    The rotor moves 1 + K_s / stiffness as far as the spring: a fit without the compliance overestimates both.
    """
    guesses = []
    for guess in defaults:
        farther = 1.0 if view.rigid_spring else 1.0 + view.value(STIFFNESS) / guess["stiffness"]
        guesses.append({**guess, **{name: view.value(name) / farther for name in (_INERTIA, _DAMPING)}})
    return guesses
