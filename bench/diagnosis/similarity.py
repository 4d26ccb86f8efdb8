"""Diagnose every effect on a machine, and on similar ones that are weaker and stronger: nothing may differ.

python -m bench diagnosis similarity --times 1e-3 30 --log out/similarity.jsonl     goes on where the log ends

A similar machine has so many times the torque, inertia, damping and stiffness; angles and times stay. Cause,
verdict and sizes, in units of its torques, should be those of the machine itself. Tried are the effect, its
look-alikes and five that any record has, on 12 s of a chirp with noise.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from similar_machine import factor, record_with, similar

from bench import parser_of
from bench.results import append_line, read_lines
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import catalogue, look_alikes
from rsea_ros.effects.effect import Effect
from rsea_ros.model.rig_file import load_rig

RIG = load_rig("paper_high_impedance")
BESIDE = ("coulomb_friction", "torque_saturation", "nonlinear_spring", "command_delay", "ft_bias")
DURATION = 12.0


def main(argv: Sequence[str]) -> int:
    """Play the records that the log lacks, then print the table; status 1 where an outcome differs."""
    parser = parser_of(__doc__)
    parser.add_argument("--times", type=float, nargs="+", default=[1e-3, 30.0], metavar="FACTOR")
    parser.add_argument("--select", default="", metavar="TEXT", help="only effects with TEXT in their name")
    parser.add_argument("--log", type=Path, required=True, metavar="FILE", help="a line of JSON each")
    args = parser.parse_args(argv)
    effects = [e for e in catalogue().values() if e.name != "gravity_error" and args.select in e.name]
    played = {(p["effect"], p["times"]): p for p in read_lines(args.log)}
    for effect in effects:
        for times in (1.0, *args.times):
            if (effect.name, times) not in played:
                played[effect.name, times] = _play(effect, times)
                append_line(args.log, played[effect.name, times])
    rows = [row for e in effects for row in _rows(e.name, args.times, played)]
    print("| effect | times | on the machine | on the similar one | largest change of a size |")
    print("|---|---|---|---|---|")
    print("\n".join(text for text, _ in rows))
    return int(not all(same for _, same in rows))


def _play(effect: Effect, times: float) -> dict[str, Any]:
    tried = {effect.name, *BESIDE, *(e.name for e in look_alikes(effect.name, catalogue().values()))}
    without = tuple(n for n in catalogue() if n not in tried)
    record, begin = record_with(RIG, effect, times, DURATION), time.perf_counter()
    d = diagnose([record], similar(RIG, times), settings=replace(DEFAULT, without=without))
    parameters = [(f"{c.name}.{n}", p) for c in d.causes for n, p in c.parameters.items()]
    sizes = {name: p.value / factor(p.unit, times) for name, p in parameters}
    return {"effect": effect.name, "times": times, "verdict": d.verdict, "causes": [c.name for c in d.causes],
            "sizes": sizes, "seconds": round(time.perf_counter() - begin, 1)}  # fmt: skip


def _rows(name: str, every: Sequence[float], played: dict[Any, Any]) -> Iterator[tuple[str, bool]]:
    one = played[name, 1.0]
    for times in every:
        other = played[name, times]
        same = (one["causes"], one["verdict"]) == (other["causes"], other["verdict"])
        shared = one["sizes"].keys() & other["sizes"].keys()
        change = max((_change(one["sizes"][n], other["sizes"][n]) for n in shared), default=0.0)
        said = ("same" if same else _summary(other)) if other is not one else ""
        yield f"| {name} | {times:g} | {_summary(one)} | {said} | {change:.1e} |", same


def _change(a: float, b: float) -> float:
    return abs(b - a) / abs(a) if a else abs(b)


def _summary(played: dict[str, Any]) -> str:
    return f"{' + '.join(played['causes']) or 'no cause'}, {played['verdict'].replace('_', ' ')}"
