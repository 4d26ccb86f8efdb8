"""What a diagnosis says in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rsea_ros.diagnosis.result import Cause, Verdict
from rsea_ros.effects.effect import Effect
from rsea_ros.fault_kinds import MASKED
from rsea_ros.identification.problem import Problem
from rsea_ros.identification.result import AT_NOISE
from rsea_ros.identification.silent import silent_channels
from rsea_ros.signals import Fault
from rsea_ros.wording import listed

_CHANNELS = {
    "ft": "F/T torque",
    "deflection": "spring deflection",
    "position": "position",
    "velocity": "velocity",
    "motor_torque": "motor torque",
}


def verdict_sentence(
    verdict: Verdict,
    causes: Sequence[Cause],
    channel: str,
    before: float,
    after: float,
    faults: Sequence[Fault],
    at_floor: bool = False,
) -> str:
    """Return the verdict as one sentence.

    before, after: held-out residual of the channel over its noise. at_floor: of all channels with all causes.
    """
    name, data = _CHANNELS[channel], _data(faults)
    named = listed([c.name.replace("_", " ") for c in causes])
    them = "them" if len(causes) > 1 else "it"
    fall = f"with {them} the {name} residual falls from {before:.1f} to"
    silent = [_CHANNELS.get(n, n) for n in silent_channels(faults)]
    if verdict == "unexplained" and silent and before <= AT_NOISE:
        return (
            f"The {listed(silent)} measures nothing and is left out; with the model's values re-fitted "
            f"the {name} residual is at the noise floor ({after:.2f} times the noise).{data}"
        )
    if verdict == "nothing_wrong":
        return (
            f"Nothing is wrong with the model: with its values re-fitted the {name} residual "
            f"is at the noise floor ({after:.2f} times the noise).{data}"
        )
    if verdict == "unexplained":
        size = f"{math.ceil(100.0 * before) / 100.0:.2f}" if before < 2.0 else f"{before:.1f}"
        return f"The {name} residual is {size} times the noise; no known effect explains it.{data}"
    if verdict == "partly_explained" and at_floor:
        doubt = "but another law may do the same"
        return f"{named.capitalize()}, probably: {fall} {after:.2f} times the noise, {doubt}.{data}"
    if verdict == "explained":
        return f"{named.capitalize()}: {fall} {after:.2f} times the noise, which is the floor.{data}"
    return f"{named.capitalize()}, a part of it: {fall} {after:.1f} times the noise; the rest is open.{data}"


def evidence_of(effect: Effect, channel: str, before: float, after: float, gain: float) -> str:
    """Return the evidence for a cause as one sentence."""
    return (
        f"With {effect.about}, the {_CHANNELS[channel]} residual of data that took no part falls "
        f"from {before:.2f} to {after:.2f} times the noise (gain {gain:.1%})."
    )


def also_in_model(names: Sequence[str]) -> tuple[str, ...]:
    """Return what the extended model has beside the causes, as sentences."""
    if not names:
        return ()
    effects = listed([n.replace("_", " ") for n in names])
    return (
        f"The extended model also has {effects}: it predicts better with it, but the data speak for another "
        "law than that.",
    )


def coherence_lost(above: float | None, channel: str) -> tuple[str, ...]:
    """Return what cannot be told because a channel is noise there, as sentences. above: Hz."""
    if above is None:
        return ()
    return (
        f"Above {above:.3g} Hz the coherence of the {_CHANNELS[channel]} with the command is lost: "
        "most of it is noise there, and what these data say of those frequencies is said by chance.",
    )


def on_measured_angle(problem: Problem) -> tuple[str, ...]:
    """Return what a reader must know of a model that was simulated on the measured rotor angle."""
    if not problem.ride:
        return ()
    return (
        "The torque ripple was fitted and judged on the measured rotor angle: a simulation that moves freely "
        "settles in other detents, so `rsea predict` will show a larger residual than the gain here.",
    )


def coloured_noise(channels: Sequence[str]) -> tuple[str, ...]:
    """Return what was taken for coloured noise of a sensor, and why, as sentences."""
    if not channels:
        return ()
    return (
        f"The noise of the {listed([_CHANNELS[n] for n in channels])} is coloured: its level was taken from "
        "the residual, which is steady, falls with frequency, and agrees with neither command nor motion nor "
        "another sensor.",
    )


def _data(faults: Sequence[Fault]) -> str:
    """Return which faults the data have, each kind once, and which samples of them are masked."""
    channels: dict[str, list[str]] = {}
    for f in faults:
        channels.setdefault(f.kind, []).append(f.channel)
    texts = {kind: f"{kind.replace('_', ' ')} in {listed(names)}" for kind, names in channels.items()}
    left = "; ".join(text for kind, text in texts.items() if kind not in MASKED)
    masked = "; ".join(text for kind, text in texts.items() if kind in MASKED)
    return (f" The data have faults: {left}." if left else "") + (
        f" Samples were masked: {masked}." if masked else ""
    )
