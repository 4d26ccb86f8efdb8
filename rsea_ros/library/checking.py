"""`rsea.check`: the data checks of a record against a rig."""

from dataclasses import dataclass

from rsea_ros.checks.finding import Finding, Findings, Light
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Record


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
        from html import escape

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

    return Checks(check_record(data, load_rig(rig), values=True))
