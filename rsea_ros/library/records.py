"""`rsea.read_bag`, `rsea.simulate` and `rsea.check`: the record of a run, and what is wrong with it."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from msg_adapters import TopicMap, read_record
from rsea_ros.checks.finding import Finding, Findings, Light
from rsea_ros.errors import ParameterError, check_kind, check_rate
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.records.record import Channel, Record, torques_from


def read_bag(
    path: str | Path | Sequence[str | Path],
    *,
    namespace: str = "/rsea",
    joint: str | None = None,
    axis: str = "torque.z",
    strict: bool = True,
) -> Record:
    """Return the record of a rosbag2 directory, an .mcap or a .db3 file, or of several files of one run.

    namespace: of the topics. joint: its name, if the messages hold several. axis: axis of the actuator in the
    wrench; a leading `-` reverses it. strict: refuse commands that are missing or not finite, and correct the
    stamps; with False all samples are kept as they were recorded.
    Raises BagError with file, topic, field, value and expected value.
    Not to be confused with `rsea import`, which converts tables to bags.
    """
    for each in path if isinstance(path, Sequence) and not isinstance(path, str) else [path]:
        check_kind("path", each, (str, Path), "a bag: a directory, an .mcap or a .db3 file")
    return read_record(path, topics=TopicMap(namespace=namespace, joint=joint, axis=axis), strict=strict)


def simulate(
    rig: Rig | str, command: npt.ArrayLike, rate: float | None = None, *, seed: int = 0, noise: bool = True
) -> Record:
    """Return the simulated record of a bench that holds each command for 1 / rate.

    command: motor torque at the gear output, N m, shape (n,); for a rig with a position loop the target, rad.
    rate: of the commands, Hz. seed: of the sensor noise. noise: False for perfect sensors. Measurements are
    stamped at the end of each hold, commands at its beginning. Raises ParameterError for no command or rate.
    Not to be confused with predict, which simulates the commands of a record and compares the result.
    """
    values = torques_from("command", command, 2)
    if rate is None:
        raise ParameterError("rate: not stated, expected that of the commands, Hz")
    check_rate(rate)
    return synthesize(load_rig(rig), Channel(np.arange(len(values)) / rate, values), seed=seed, noise=noise)


@dataclass(frozen=True)
class Checks:
    """Findings of a check with a traffic light each. `result` also holds the faults of the data."""

    result: Findings

    @property
    def light(self) -> Light:
        """The worst light: `green`, `amber` or `red`."""
        return self.result.light

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings, each with light, value, unit, expected value and remedy."""
        return self.result.findings

    def summary(self) -> str:
        """Return the findings in plain text."""
        from rsea_ros.report.check import check_lines

        return "\n".join(line.plain for line in check_lines(self.result))

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"

    def __repr__(self) -> str:
        """Return the rig, the worst light and the findings that are not green in one line."""
        marked = [f"{f.kind} {f.channel}".strip() for f in self.findings if f.light != "green"]
        return f"Checks({self.result.rig_name}: {self.light}{': ' if marked else ''}{', '.join(marked)})"


def check(data: Record, rig: Rig | str) -> Checks:
    """Check a record against a rig: gaps, clocks, noise, dead channels, sign, scale, excitation.

    rig: a Rig, a file, or the name of a rig in config/rigs. The record is not changed. Bad data are findings,
    not errors; raises RigError for the rig. Takes seconds, and fits no physics beyond a linear response.
    """
    from rsea_ros.checks.check import check_record

    check_kind("data", data, Record, "a Record (Record.from_arrays, rsea.read_bag)")
    return Checks(check_record(data, load_rig(rig), values=True))
