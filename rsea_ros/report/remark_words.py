"""In words: which rig a result was made with, faults of its data, remarks of its fit or diagnosis."""

import math
import shlex
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rsea_ros.documents.wording import list_names
from rsea_ros.identification.result import Code, Remark
from rsea_ros.model.rig import CLOCK_DOUBT
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.records.record import MASKED, Fault
from rsea_ros.report import words
from rsea_ros.report.page import Html, bullets, code, section
from rsea_ros.report.result_files import MODEL, strict


def fault(*alike: Fault) -> str:
    """Return `outliers in F/T torque, 0.04 % of the samples`.

    alike: the same fault of several channels or records.
    """
    f, channels = alike[0], list(dict.fromkeys(f.channel for f in alike))
    names = list_names([words.channel(channel) for channel in channels])
    if f.kind == "missing_topic":
        return f"{names} {'are' if len(channels) > 1 else 'is'} missing"
    detail = f" ({f.detail})" if f.detail else ""
    place = f" in {names}" if f.channel else ""
    return f"{words.fault(f.kind)}{place}{_size(f)}{detail}"


def _size(f: Fault) -> str:
    size = 0.0 if f.size is None else float(f.size)
    number = f"{size:.0f}" if size.is_integer() else words.number(size, 3)
    share = f", {words.number(100.0 * f.share, 2)} % of the samples" if math.isfinite(f.share) else ""
    return ("" if f.size is None else f", {number} {words.unit(f.unit)}".rstrip()) + share


def fault_lines(items: Sequence[Fault]) -> list[str]:
    """Return one line for the faults of a kind that are equally large in several channels."""
    groups: dict[tuple[str, str, str], list[Fault]] = {}
    for f in items:
        groups.setdefault((f.kind, _size(f), f.detail), []).append(f)
    return [fault(*alike) for alike in groups.values()]


def found_faults(faults: Iterable[Fault]) -> str:
    """Return which faults the data have, each kind once, and which samples are masked; each after a space."""
    kinds: dict[str, dict[str, None]] = {}
    for f in faults:
        kinds.setdefault(f.kind, {})[words.channel(f.channel)] = None
    texts: dict[bool, list[str]] = {False: [], True: []}
    for kind, channels in kinds.items():
        names = list_names([*channels])
        where = f"{words.fault(kind)} in {names}".removesuffix(" in ")
        text = f"{names} missing" if kind == "missing_topic" else where
        texts[kind in MASKED].append(text)
    openings = (" The data have faults", " Samples were masked")
    return "".join(f"{o}: {'; '.join(t)}." for o, t in zip(openings, texts.values(), strict=True) if t)


_FIXES = "A measured spring stiffness, the encoder (position), or a known inertia would fix it."
_FIXES_LOOP = "A measured motor torque, a gain known from the firmware, or a known inertia would fix it."
_MEASURE = "Measure it separately, or excite it more."
_REMEDY = {
    "spring.damping": "Excitation above the resonance, or F/T sensor with encoder, would determine it.",
    "housing_end.damping": "A free swing of the housing would determine it.",
}
_NOT_IDENTIFIABLE = "{name} is not identifiable from these data: "
_WORDS: Mapping[Code, str] = {
    "even_clocks": "Stamps scatter about an even clock: {scatter}. The values agree with the even clock, so "
    "the fit uses it.",
    "clocks_taken_as_right": "The sensors' clocks are taken as right unless the data demand a correction. "
    f"If each were uncertain by {1e6 * CLOCK_DOUBT:.0f} µs, the interval of {{name}} would be {{v[0]:.1f}} "
    "times as wide.",
    "torque_by_motor_constant": "No F/T sensor takes part in this fit, so every torque is known only "
    "through the motor constant: a constant g times as large scales inertia, damping and stiffness by g.",
    "torque_by_loop_gains": "No F/T sensor takes part in this fit, so every torque is known only through "
    "the loop's gains, and through the motor constant where a current was measured: gains g times as large "
    "scale inertia, damping and friction by g.",
    "at_bound": "{name} ran to its bound, {v[0]:.3g} {unit}: these data show nothing of it, or something "
    "that the rig lacks stands in for it.",
    "not_shown": _NOT_IDENTIFIABLE + "they do not show it. {remedy}",
    "only_prior": _NOT_IDENTIFIABLE + "what is known of it is the rig's prior. {remedy}",
    "only_ratios": "Only ratios of {names} are identifiable from these data: a common factor is taken from "
    "the rig. {fixes}",
    "only_together": f"{{names}} are identifiable from these data only together, not each. {_MEASURE}",
    "play_undetermined": "These data cannot determine the play in the gear: with {milli:.2g} mrad, which "
    "fits best, the residual of data that took no part changes by {fall:+.1f} %.",
    "also_in_model": "The extended model also has {effects}: it predicts better with it, but the data speak "
    "for another law than that.",
    "coherence_lost": "Above {v[0]:.3g} Hz the coherence of the {channels} with the command is lost: most "
    "of it is noise there, and these data say little about those frequencies.",
    "on_measured_angle": "The torque ripple was fitted and tested on the measured rotor angle: a simulation "
    "that moves freely settles in other detents, so `rsea predict` will show a larger residual than the "
    "gain here.",
    "coloured_noise": "The noise of the {channels} is coloured: its level was taken from the residual, "
    "which is steady, falls with frequency, and agrees with neither command nor motion nor another sensor.",
    "off_rig": "{name} differs from the rig: the rig states {stated} {unit}, the fit gives {fitted} {unit} "
    "({doubt}), {spreads} of the stated spreads away.",
    "differs": "{name} differs as stated: {others}.",
    "other_records": "Nothing was fitted to {names}, of which the rig has conditions too.",
    "stretches": "Models were fitted and tested on {v[0]:.0f} s of the {v[1]:.0f} s recorded: on stretches "
    "spread evenly, and on those that the nominal model simulates worst. The data were checked in full.",
    "unseen_spring": "The mode of rotor and load on the spring, {v[0]:.3g} Hz, lies above the {v[1]:.3g} Hz "
    "of the record: the spring was taken as rigid, and the torque was judged along the measured motion.",
    "lost_cycles": "{v[0]:.0f} lost cycles of the driver are a likely cause of the misfit: behind them the "
    "motor torque is further from its commands than elsewhere. What is named here may stand in for them: "
    "record again on an idle computer.",
}


def remark_sentences(remarks: Iterable[Remark]) -> tuple[str, ...]:
    """Return each remark as a sentence or two."""
    return tuple(_sentence(remark) for remark in remarks)


def coloured_noise(channels: Iterable[str]) -> str:
    """Return the residuals that were taken for coloured noise of sensors, and why."""
    return _sentence(Remark("coloured_noise", tuple(channels)))


def _sentence(r: Remark) -> str:
    name, v = (r.names or ("",))[0], r.values
    fields: dict[str, object] = {
        "name": name, "names": list_names(r.names), "v": v, "unit": words.unit(r.unit),
        "channels": list_names([words.channel(n) for n in r.names]),
        "others": list_names(r.names[1:]),
        "effects": list_names([words.effect(n) for n in r.names]),
        "remedy": _REMEDY.get(name, _MEASURE),
        "fixes": _FIXES_LOOP if any(n.startswith("controller.") for n in r.names) else _FIXES,
    }  # fmt: skip
    if r.code == "even_clocks":
        fields["scatter"] = list_names(
            [f"{n} by {1e3 * s:.2g} ms RMS" for n, s in zip(r.names, v, strict=True)]
        )
    if r.code == "play_undetermined":
        fields |= {"milli": 1e3 * v[0], "fall": -100.0 * v[1]}
    if r.code == "off_rig":
        sure = math.isfinite(v[2])
        fields |= {"stated": words.number(v[0], 4), "spreads": words.number(v[4], 2)}
        fields |= {"fitted": "".join(words.with_doubt(*v[1:4])) if sure else words.number(v[1], 4),
                   "doubt": "95 %" if sure else "no interval"}  # fmt: skip
    return _WORDS[r.code].format(**fields)


def rig_named(name: str, choice: RigChoice) -> str:
    """Return `my_bench`, `my_bench (fitted/model.yaml)`, or that a rig is the default."""
    if choice.is_default:
        return f"{name} (the default: no --rig was given)"
    return f"{name} ({choice.option})" if choice.option not in ("", name) else name


def rig_in_brackets(name: str, choice: RigChoice) -> str:
    """Return the same for brackets: `rig my_bench, fitted/model.yaml` or `default rig …`."""
    if choice.is_default:
        return f"default rig {name}"
    return f"rig {name}, {choice.option}" if choice.option not in ("", name) else f"rig {name}"


def split_off_rig(remarks: Sequence[Remark]) -> tuple[list[Remark], list[Remark]]:
    """Return the remarks on values that are far from the rig's, and the others."""
    return [r for r in remarks if r.code == "off_rig"], [r for r in remarks if r.code != "off_rig"]


def values_off(remarks: Sequence[Remark]) -> str:
    """Return `2 values differ from the rig` of remarks; empty for none."""
    count = len(split_off_rig(remarks)[0])
    return f"{count} value{'s differ' if count > 1 else ' differs'} from the rig" if count else ""


def right_rig(fitted: str = "") -> str:
    """Return the question whether the rig is right, and what to do. fitted: a rig with the fitted values."""
    values = f"continue with --rig {shlex.quote(fitted)}" if fitted else "make a rig of the fitted ones:"
    return f"Is this the right rig? If not, name yours with --rig; if only its values are old, {values}"


def command(verb: str, sources: Sequence[str], name: str, choice: RigChoice, rig: str = "") -> str:
    """Return the command that calls a verb on the same part of the same data.

    name: of the rig, used if it was passed as a Rig. rig: another than that of the choice, conditions in it.
    """
    differs = ["--conditions", choice.conditions] if choice.conditions and not rig else []
    options = ["--rig", rig or choice.option or name, *differs, *choice.topics, *choice.part]
    return shlex.join(["rsea", verb, *sources, *options])


def right_rig_block(remarks: Sequence[Remark], command: str = "") -> Html:
    """Return the values that differ from the rig and what to do about it; empty for none.

    command: makes a rig of the fitted values; without one, model.yaml beside the page is that rig.
    """
    off, _ = split_off_rig(remarks)
    if not off:
        return Html()
    remedy = Html(f"<p>{right_rig('' if command else MODEL)} {code(command) if command else ''}</p>")
    return section("Values that differ from the rig", bullets(remark_sentences(off)), remedy)


def rig_json(choice: RigChoice, remarks: Sequence[Remark]) -> dict[str, Any]:
    """Return how the rig was given, and each value that is far from it."""
    off = []
    for remark in split_off_rig(remarks)[0]:
        stated, fitted, low, high, spreads = remark.values
        off.append({"name": remark.names[0], "rig": stated, "fitted": fitted, "ci95": [low, high],
                    "unit": remark.unit, "spreads": spreads})  # fmt: skip
    return {"rig_option": choice.option or None, "rig_is_default": choice.is_default, "off_rig": strict(off)}
