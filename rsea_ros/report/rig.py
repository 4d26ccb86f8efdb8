"""Which rig a result was made with, and what speaks against it: in words, as HTML, for programs."""

import shlex
from collections.abc import Sequence
from typing import Any

from rsea_ros.identification.result import Remark
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.report.page import Html, bullets, code, section
from rsea_ros.report.remark_words import remark_sentences
from rsea_ros.report.result_files import MODEL, strict


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

    name: of the rig, used if it was passed as a Rig. rig: another rig than that of the choice.
    """
    options = ["--rig", rig or choice.option or name, *choice.topics, *choice.part]
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
