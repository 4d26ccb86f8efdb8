"""Outcomes of the benchmark over one number of DiagnosisSettings: why it has its value.

python -m bench diagnosis settings_curve acceptance.fall 0.05 0.1 0.2 --limit 24
python -m bench diagnosis settings_curve --list
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

from bench import parser_of
from bench.diagnosis.cases import plan
from bench.diagnosis.outcome import Outcome, run_case
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.report.diagnosis.page import value_text


def main(argv: Sequence[str]) -> int:
    """Print a line for each value: cases right, wrong causes, missed causes, seconds."""
    args = _parser().parse_args(argv)
    if args.list or args.setting is None:
        for s in DEFAULT.numbers():
            print(f"{s.name:<30}{value_text(s.value):>8} {s.unit:<3} {s.meaning}: {s.reason}")
        return 0
    plans = [p for p in plan(args.seed) if args.select in f"{p.name} {p.group}"]
    count = min(args.limit or len(plans), len(plans))
    plans = [plans[k * len(plans) // count] for k in range(count)]
    print(f"{args.setting:<30}right  wrong causes  missed  seconds   of {count} cases")
    for value in args.values:
        outcomes = [run_case(p.make(), settings=with_value(DEFAULT, args.setting, value)) for p in plans]
        print(_line(value, outcomes), flush=True)
    return 0


def with_value(settings: DiagnosisSettings, name: str, value: float) -> DiagnosisSettings:
    """Return the settings with one number changed, `group.field`. Raises SystemExit for any other name."""
    known = {s.name: s.value for s in settings.numbers() if not isinstance(s.value, tuple)}
    if name not in known:
        raise SystemExit(f"{name}: no such setting, expected one of {', '.join(known)}")
    group, field = name.split(".")
    changed = replace(getattr(settings, group), **{field: type(known[name])(value)})
    return replace(settings, **{group: changed})


def _line(value: float, outcomes: Sequence[Outcome]) -> str:
    right = sum(o.right for o in outcomes)
    wrong = sum(len(set(o.named) - set(o.truth)) for o in outcomes)
    missed = sum(len(set(o.truth) - set(o.named)) for o in outcomes)
    seconds = sum(o.seconds for o in outcomes)
    return f"{value:<30g}{right:>5}{wrong:>14}{missed:>8}{seconds:>9.0f}"


def _parser() -> argparse.ArgumentParser:
    parser = parser_of(__doc__)
    parser.add_argument("setting", nargs="?", metavar="GROUP.FIELD", help="which number to change")
    parser.add_argument("values", nargs="*", type=float, metavar="VALUE", help="what to set it to, in turn")
    parser.add_argument("--list", action="store_true", help="print every setting and its reason")
    parser.add_argument("--select", default="", metavar="TEXT", help="only cases with TEXT in name or group")
    parser.add_argument("--limit", type=int, metavar="N", help="only N cases, spread evenly over all")
    parser.add_argument("--seed", type=int, default=2024, help="seed of the cases (default %(default)s)")
    return parser
