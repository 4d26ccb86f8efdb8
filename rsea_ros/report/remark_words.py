"""The remarks of a fit or a diagnosis in words."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from rsea_ros.documents.wording import list_names
from rsea_ros.identification.result import Code, Remark
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.report import words

_TORQUE_BY_MOTOR_CONSTANT = (
    "No F/T sensor takes part in this fit, so every torque is known only through the motor constant: "
    "a constant g times as large scales inertia, damping and stiffness by g."
)
_TORQUE_BY_LOOP_GAINS = (
    "No F/T sensor takes part in this fit, so every torque is known only through the loop's gains, and "
    "through the motor constant where a current was measured: gains g times as large scale inertia, damping "
    "and friction by g."
)
_ON_MEASURED_ANGLE = (
    "The torque ripple was fitted and tested on the measured rotor angle: a simulation that moves freely "
    "settles in other detents, so `rsea predict` will show a larger residual than the gain here."
)
_FIXES = "A measured spring stiffness, the encoder (position), or a known inertia would fix it."
_FIXES_LOOP = "A measured motor torque, a gain known from the firmware, or a known inertia would fix it."
_MEASURE = "Measure it separately, or excite it more."
_REMEDY = {
    "spring.damping": "Excitation above the resonance, or F/T sensor with encoder, would determine it.",
    "housing_end.damping": "A free swing of the housing would determine it.",
}


def remark_sentences(remarks: Iterable[Remark]) -> tuple[str, ...]:
    """Return each remark as a sentence or two."""
    return tuple(_WORDS[remark.code](remark) for remark in remarks)


def coloured_noise(channels: Iterable[str]) -> str:
    """Return the residuals that were taken for coloured noise of sensors, and why."""
    names = list_names([words.channel(n) for n in channels])
    return (
        f"The noise of the {names} is coloured: its level was taken "
        "from the residual, which is steady, falls with frequency, and agrees with neither command nor "
        "motion nor another sensor."
    )


def _even_clocks(remark: Remark) -> str:
    scatter = zip(remark.names, remark.values, strict=True)
    sizes = list_names([f"{n} by {1e3 * s:.2g} ms RMS" for n, s in scatter])
    return (
        f"Stamps scatter about an even clock: {sizes}. The values agree with the even clock, "
        "so the fit uses it."
    )


def _clocks_taken_as_right(remark: Remark) -> str:
    return (
        "The sensors' clocks are taken as right unless the data demand a correction. If each were "
        f"uncertain by {1e6 * CLOCK_DOUBT:.0f} µs, the interval of {remark.names[0]} would be "
        f"{remark.values[0]:.1f} times as wide."
    )


def _at_bound(remark: Remark) -> str:
    return (
        f"{remark.names[0]} ran to its bound, {remark.values[0]:.3g} {words.unit(remark.unit)}: "
        "these data show nothing of it, or something that the rig lacks stands in for it."
    )


def _not_identifiable(remark: Remark) -> str:
    name, is_prior = remark.names[0], remark.code == "only_prior"
    source = "what is known of it is the rig's prior" if is_prior else "they do not show it"
    return f"{name} is not identifiable from these data: {source}. {_REMEDY.get(name, _MEASURE)}"


def _only_ratios(remark: Remark) -> str:
    is_loop = any(name.startswith("controller.") for name in remark.names)
    return (
        f"Only ratios of {list_names(remark.names)} are identifiable from these data: a common factor is "
        f"taken from the rig. {_FIXES_LOOP if is_loop else _FIXES}"
    )


def _only_together(remark: Remark) -> str:
    return f"{list_names(remark.names)} are identifiable from these data only together, not each. {_MEASURE}"


def _play_undetermined(remark: Remark) -> str:
    gap, gain = remark.values
    return (
        f"These data cannot determine the play in the gear: with {1e3 * gap:.2g} mrad, which fits best, the "
        f"residual of data that took no part changes by {-100.0 * gain:+.1f} %."
    )


def _also_in_model(remark: Remark) -> str:
    effects = list_names([words.effect(n) for n in remark.names])
    return (
        f"The extended model also has {effects}: it predicts better with it, but the data speak for another "
        "law than that."
    )


def _coherence_lost(remark: Remark) -> str:
    return (
        f"Above {remark.values[0]:.3g} Hz the coherence of the {words.channel(remark.names[0])} with the "
        "command is lost: most of it is noise there, and these data say little about those frequencies."
    )


def _off_rig(remark: Remark) -> str:
    stated, value, low, high, spreads = remark.values
    fitted, doubt = words.with_doubt(value, low, high)
    unit = words.unit(remark.unit)
    return (
        f"{remark.names[0]} differs from the rig: the rig states {words.number(stated, 4)} {unit}, the fit "
        f"gives {fitted}{doubt} {unit} (95 %), {words.number(spreads, 2)} of the stated spreads away."
    )


def _stretches(remark: Remark) -> str:
    used, whole = remark.values
    return (
        f"Models were fitted and tested on {used:.0f} s of the {whole:.0f} s recorded: on stretches spread "
        "evenly, and on those that the nominal model simulates worst. The data were checked in full."
    )


def _lost_cycles(remark: Remark) -> str:
    return (
        f"{remark.values[0]:.0f} lost cycles of the driver are a likely cause of the misfit: behind them the "
        "motor torque is further from its commands than elsewhere. What is named here may stand in for them: "
        "record again on an idle computer."
    )


_WORDS: Mapping[Code, Callable[[Remark], str]] = {
    "even_clocks": _even_clocks,
    "clocks_taken_as_right": _clocks_taken_as_right,
    "torque_by_motor_constant": lambda remark: _TORQUE_BY_MOTOR_CONSTANT,
    "torque_by_loop_gains": lambda remark: _TORQUE_BY_LOOP_GAINS,
    "at_bound": _at_bound,
    "not_shown": _not_identifiable,
    "only_prior": _not_identifiable,
    "only_ratios": _only_ratios,
    "only_together": _only_together,
    "play_undetermined": _play_undetermined,
    "also_in_model": _also_in_model,
    "coherence_lost": _coherence_lost,
    "on_measured_angle": lambda remark: _ON_MEASURED_ANGLE,
    "coloured_noise": lambda remark: coloured_noise(remark.names),
    "off_rig": _off_rig,
    "stretches": _stretches,
    "lost_cycles": _lost_cycles,
}
