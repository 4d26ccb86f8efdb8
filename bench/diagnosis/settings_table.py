"""Curves of outcomes over the settings that matter most, on a few short records, as docs/settings.md.

python -m bench diagnosis settings_table play --log out/settings.jsonl     goes on where the log ends
python -m bench diagnosis settings_table page --log out/settings.jsonl     writes docs/settings.md

A record is diagnosed with every value in turn and its fits are kept meanwhile (remembered_fits.py).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from bench import ROOT, parser_of
from bench.diagnosis.cases import Case, Plan, plan
from bench.diagnosis.outcome import run_case
from bench.diagnosis.remembered_fits import remember_fits
from bench.diagnosis.settings_curve import with_value
from rsea_ros.diagnosis.settings import DEFAULT

CURVES = {
    "acceptance.fall": (0.03, 0.1, 0.2, 0.3),
    "acceptance.matters": (0.005, 0.05, 0.1),
    "acceptance.fall_in_doubt": (0.1, 0.2, 0.5),
    "floor.misfit": (1.2, 2.0, 3.0),
    "floor.reached": (1.05, 1.2, 1.4),
    "forward.piece_fits": (3, 5, 15),
    "forward.full_fits": (1, 2, 6),
    "forward.hope_one": (0.8, 0.9, 1.0),
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
PAGE = ROOT / "docs" / "settings.md"


@dataclass(frozen=True)
class Played:
    """One record diagnosed with one value of one setting. setting "" : all as they are."""

    case: str
    setting: str
    value: float
    truth: tuple[str, ...]
    named: tuple[str, ...]
    statuses: tuple[str, ...]
    verdict: str
    right: bool
    seconds: float


def main(argv: Sequence[str]) -> int:
    """Play the records that the log lacks, or write its page."""
    parser = parser_of(__doc__)
    parser.add_argument("do", choices=("play", "page"))
    parser.add_argument("--log", type=Path, required=True, metavar="FILE", help="a line of JSON each")
    args = parser.parse_args(argv)
    if args.do == "play":
        _play(args.log)
    else:
        PAGE.write_text(page(read(args.log)))
    return 0


def _play(log: Path) -> None:
    done = {(p.case, p.setting, p.value) for p in read(log)}
    log.parent.mkdir(parents=True, exist_ok=True)
    for one in _plans():
        wanted = [(s, v) for s, v in _values() if (one.name, s, v) not in done]
        if not wanted:
            continue
        case = one.make()
        with remember_fits(), log.open("a") as lines:
            for setting, value in wanted:
                lines.write(json.dumps(asdict(_played(case, setting, value))) + "\n")
                lines.flush()


def _played(case: Case, setting: str, value: float) -> Played:
    settings = with_value(DEFAULT, setting, value) if setting else DEFAULT
    o = run_case(case, settings=settings)
    return Played(case.name, setting, value, o.truth, o.named, o.statuses, o.verdict, o.right, o.seconds)


def _plans() -> Iterator[Plan]:
    known = {p.name: p for p in plan()}
    return (replace(known[name], duration=DURATION) for name in CASES)


def _values() -> Iterator[tuple[str, float]]:
    yield "", 0.0
    for setting, values in CURVES.items():
        yield from ((setting, float(v)) for v in values)


def read(log: Path) -> list[Played]:
    """Return the entries of a log; a truncated last line does not count."""
    lines = log.read_text().splitlines() if log.exists() else []
    return [Played(**{k: tuple(v) if isinstance(v, list) else v for k, v in json.loads(line).items()})
            for line in lines if line.endswith("}")]  # fmt: skip


def page(played: Sequence[Played]) -> str:
    """Return docs/settings.md: for each setting the outcomes over its values, and whether they change."""
    in_use = {s.name: s for s in DEFAULT.numbers()}
    done = {(p.case, p.setting, p.value) for p in played}
    whole = [name for name in CASES if all((name, s, v) in done for s, v in _values())]
    names = ", ".join(f"`{name}`" for name in whole)
    parts = [
        "# Curves of the settings", "",
        f"Ten numbers that steer a verdict, each moved alone over {len(whole)} short records ({DURATION:g} s "
        "at 280 Hz): mild effects, which a threshold loses first, several at once, nothing wrong, and causes "
        "that no effect explains. Short and few: a curve shows which way a number acts and how far it can "
        "move before an outcome changes, not how often a diagnosis is right ([results](results.md)).", "",
        f"The records: {names}.", "",
        "Right: the hidden causes and no other are named. Wrong: causes named that are none, in all records. "
        "Missed: hidden causes not named. Changed: records whose causes, their statuses or verdict differ "
        "from those at the value in use, in bold.", "",
        "Made by `python -m bench diagnosis settings_table`; `python -m bench diagnosis settings_curve` plays any "
        "setting on longer records.",
        "",
    ]  # fmt: skip
    for name in CURVES:
        rows = list(_rows(name, float(in_use[name].value), [p for p in played if p.case in whole]))
        flat = all(changed == 0 for *_, changed in rows)
        parts += [f"## {name}", "", f"{in_use[name].meaning[:1].upper()}{in_use[name].meaning[1:]}.", ""]
        parts += ["| value | right | wrong | missed | changed |", "|---|---|---|---|---|"]
        for value, right, wrong, missed, changed in rows:
            shown = f"**{value:g}**" if value == in_use[name].value else f"{value:g}"
            parts.append(f"| {shown} | {right} | {wrong} | {missed} | {changed} |")
        parts += ["", *(["Flat: no outcome changes on these records.", ""] if flat else [])]
    return "\n".join(parts)


def _rows(name: str, in_use: float, played: Sequence[Played]) -> Iterator[tuple[float, int, int, int, int]]:
    """Yield value, right, wrong, missed and changed."""
    base = {p.case: p for p in played if p.setting == ""}
    curve = {v: {p.case: p for p in played if (p.setting, p.value) == (name, v)} for v in CURVES[name]}
    for value, outcomes in sorted({**curve, in_use: base}.items()):
        some = list(outcomes.values())
        yield (
            value,
            sum(p.right for p in some),
            sum(len(set(p.named) - set(p.truth)) for p in some),
            sum(len(set(p.truth) - set(p.named)) for p in some),
            sum(_summary(p) != _summary(base[p.case]) for p in some),
        )


def _summary(played: Played) -> tuple[object, ...]:
    return played.named, played.statuses, played.verdict
