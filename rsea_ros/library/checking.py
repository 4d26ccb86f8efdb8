"""`rsea.check`: what a record is worth for a rig, before physics is fitted to it."""

from __future__ import annotations

from dataclasses import dataclass

from rsea_ros.checks.finding import Finding, Findings, Light
from rsea_ros.library.frames import plain
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.signals import Record


@dataclass(frozen=True)
class Checks:
    """Findings of a check, one traffic light each. `result` holds them with the faults of the data."""

    result: Findings

    @property
    def light(self) -> Light:
        """The worst light: `green`, `amber` or `red`."""
        return self.result.light

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was looked at, each with light, value, unit, what was expected and what would help."""
        return self.result.findings

    def summary(self) -> str:
        """Return the findings as a table in plain text."""
        from rsea_ros.report.check.text import check_table

        return plain(check_table(self.result))

    def __repr__(self) -> str:
        """Return rig, worst light and what is not green in one line."""
        marked = [f"{f.kind} {f.channel}".strip() for f in self.findings if f.light != "green"]
        return f"Checks({self.result.rig_name}: {self.light}{': ' if marked else ''}{', '.join(marked)})"


def check(data: Record, rig: Rig | str) -> Checks:
    """Check a record against a rig: gaps, clocks, noise, dead channels, sign, scale, excitation.

    Nothing is changed by it. Raises RigError for the rig, and nothing for data that are merely bad.
    """
    from rsea_ros.checks.check import check_record

    return Checks(check_record(data, load_rig(rig)))
