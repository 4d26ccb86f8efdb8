"""A finding: a line with its light, channel and share; channels that nothing used."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from rsea_ros.checks.pairs import Pair
from rsea_ros.model.inverse import is_inverse
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import RigChoice
from rsea_ros.records.record import COMMANDS, BoolArray, Fault, Record

Light = Literal["green", "amber", "red"]
LIGHTS: tuple[Light, ...] = ("green", "amber", "red")


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    kind: `topics`, `rate`, `gaps`, `order`, `clock_offset`, `clock_drift`, `noise`, `quantum`, `sign`,
    `scale`, `contradiction`, `offset`, `angle_jumps`, `standstill`, `wrong_rig`, `rig_value`, `excitation`,
    `rest`, `identifiability`, or the kind of a fault of the data.
    channel: the channel or rig value concerned, empty for the whole record.
    value, low, high: the number with its 95 % interval, in `unit`, where one belongs to it.
    expected: the green range. detail: what and where. remedy: the advice, or the option to give.
    """

    light: Light
    kind: str
    channel: str = ""
    value: float | None = None
    unit: str = ""
    low: float | None = None
    high: float | None = None
    expected: str = ""
    detail: str = ""
    remedy: str = ""


@dataclass(frozen=True)
class Findings:
    """All findings of a record compared with a rig, the most important first.

    faults: those of the data, of which every result made from the record repeats the whole list.
    pairs: what the channels say of each other. masked: which samples must not count, by channel, at the
    repaired stamps.
    """

    source: str
    rig_name: str
    findings: tuple[Finding, ...]
    faults: tuple[Fault, ...] = ()
    rig_choice: RigChoice = field(default_factory=RigChoice)
    pairs: tuple[Pair, ...] = ()
    masked: Mapping[str, BoolArray] = field(default_factory=dict, repr=False, compare=False)

    @property
    def light(self) -> Light:
        """The worst light of all."""
        return worst([f.light for f in self.findings])

    def of(self, kind: str) -> tuple[Finding, ...]:
        """Return the findings of a kind."""
        return tuple(f for f in self.findings if f.kind == kind)


def worst(lights: Sequence[Light]) -> Light:
    """Return the worst of some lights, green for none."""
    return max(lights, key=LIGHTS.index, default="green")


def unused_sentence(record: Record, rig: Rig) -> str:
    """Return which channels a fit does not use and why, empty where it uses all.

    A drive without a spring, and one that is moved, is judged by its torque; only a MIT frame has a torque
    beside its targets.
    """
    beside = {"velocity"} if is_inverse(rig) else set()
    unused = ", ".join(n for n in record.channels if not rig.measures(n) or n in beside)
    judge = "judged by its torque, a rig without a spring" if rig.rigid_spring else "a measured motion"
    said = [f"{judge} makes no use of {unused}"] if unused else []
    targets = [n for n in COMMANDS if n in record and n != "reference"]
    if targets and rig.loop not in (None, "mit") and "reference" in record:
        said.append(f"a {rig.loop} loop makes no use of {', '.join(targets)} beside reference; `mit` does")
    return "; ".join(said)


_IN_A_MAP = (
    (r"name (its|their) topic with --topic( [a-z_]+=…)?", r"name \1 column in the import map"),
    (r"axis \(--axis\)", "column"),
    (r"--axis \S+", "`sign: -1` for ft in the import map"),
    (r"another joint with --joint", "another column in the import map"),
)
"""What an option for the topics of a bag is for a table that was imported."""


def in_words_of(record: Record, finding: Finding) -> Finding:
    """Return a finding whose remedy names what its user has: options for a bag, the map for a table."""
    remedy = finding.remedy
    for option, key in _IN_A_MAP if record.is_table else ():
        remedy = re.sub(option, key, remedy)
    return replace(finding, remedy=remedy)


def missing_command(record: Record) -> str:
    """Return the remedy for a record without commands."""
    if not record.is_table:
        return "record the commands, or name their topic with --topic torque_command=…"
    if any(note.startswith("static readings") for note in record.notes):
        return "record a motion: these are static readings"
    own = ", or the column of motor_torque where no other was logged" if "motor_torque" in record else ""
    return f"map the commanded torque or current as `command`{own}"
