"""Outcomes over one number of DiagnosisSettings, each number moved alone: why it has its value.

    settings                                       the eight curves of docs/settings.md
    settings acceptance.fall 0.05 0.2 --limit 24   one, on records of the benchmark
    settings --list                                every number and its reason

Right: the hidden causes and no other are named. Wrong: causes named that are none. Missed: hidden causes not
named. Changed: records whose causes, statuses or verdict differ from those at the value in use, in bold.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from bench.diagnosis.cases import Plan, plan
from bench.diagnosis.played import Line, is_right, play, said, verdict_on
from bench.results import Row, append_line, read_lines
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.report.diagnosis.page import value_text

CURVES: Mapping[str, Sequence[float]] = {
    "acceptance.fall": (0.03, 0.1, 0.2, 0.3),
    "acceptance.matters": (0.005, 0.05, 0.1),
    "acceptance.fall_in_doubt": (0.1, 0.2, 0.5),
    "floor.reached": (1.05, 1.2, 1.4),
    "forward.piece_fits": (3, 5, 15),
    "forward.full_fits": (1, 2, 6),
    "naming.confirmed_at_floor": (0.5, 0.9, 0.98),
    "naming.confirmed": (0.8, 0.9, 0.995),
}
"""Values of each setting that are played beside its own."""
CASES = (
    "coulomb_friction-mild-chirp_noise", "stribeck_friction-mild-multisine", "backlash-mild-chirp_noise",
    "spring_hysteresis-mild-multisine", "current_loop_lag-mild-chirp_noise", "clean-00",
    "off-friction_by_angle-1.4", "taken_out-coulomb_friction", "coulomb_friction+command_delay",
    "nonlinear_spring+damping_drift", "torque_constant_error+structural_resonance",
    "stiffness_drift+damping_drift+ft_drift-medium",
)  # fmt: skip
"""Mild effects, which a threshold loses first; none; one outside the catalogue; two and three at once."""
DURATION = 12.0
IN_USE = {s.name: s.value for s in DEFAULT.numbers() if not isinstance(s.value, tuple)}


def main(
    setting: Annotated[str, IN_USE] = "", values: tuple[float, ...] = (), *, list_: bool = False,
    select: str = "", limit: int = 0, log: Path = Path("out/settings.jsonl"),
) -> Iterator[Row | str]:  # fmt: skip
    """Print a table for each setting: right, wrong, missed and changed over its values.

    setting: to change, GROUP.FIELD
    values: what to set it to, in turn
    list_: print every setting and its reason
    select: only cases with this text in name or group
    limit: only so many cases, spread evenly over all
    log: goes on where it ends
    """
    if list_:
        for s in DEFAULT.numbers():
            yield f"{s.name:<30}{value_text(s.value):>8} {s.unit:<3} {s.meaning}: {s.reason}"
        return
    curves, plans = CURVES, [replace(p, duration=DURATION) for p in plan() if p.name in CASES]
    if setting:
        curves = {setting: values}
        plans = [p for p in plan() if select in f"{p.name} {p.group}"]
        count = min(limit or len(plans), len(plans))
        plans = [plans[k * len(plans) // count] for k in range(count)]
    for name, tried in curves.items():
        yield f"\n{name}, {len(plans)} records"
        used = float(IN_USE[name])
        base = [_played(p, name, used, log) for p in plans]
        for value in sorted({*map(float, tried), used}):
            counts = _counts([_played(p, name, value, log) for p in plans], base)
            yield Row(f"**{value:g}**" if value == used else f"{value:g}", "", counts)


def with_value(name: str, value: float) -> DiagnosisSettings:
    """Return the settings with one number changed, `group.field`."""
    group, field = name.split(".")
    changed = replace(getattr(DEFAULT, group), **{field: type(IN_USE[name])(value)})
    return replace(DEFAULT, **{group: changed})


def _played(case: Plan, setting: str, value: float, log: Path) -> Line:
    """Return the line of a record with a value, from the log where it is there. The value in use: once."""
    changed = "" if value == IN_USE[setting] else f"/{setting}={value:g}"
    name = f"{case.name}/{case.duration:g}{changed}"
    known = next((line for line in read_lines(log) if line["record"] == name), None)
    if known is None:
        known = play(name, case.make(), with_value(setting, value))
        append_line(log, known)
    return known


def _counts(lines: Sequence[Line], base: Sequence[Line]) -> dict[str, str]:
    verdicts = [verdict_on(line) for line in lines]
    return {
        "right": str(sum(map(is_right, lines))),
        "wrong": str(sum(len(v.wrong) for v in verdicts)),
        "missed": str(sum(len(v.missed) for v in verdicts)),
        "changed": str(sum(said(a) != said(b) for a, b in zip(lines, base, strict=True))),
    }
