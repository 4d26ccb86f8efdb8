"""The matrix: every rig, every verb, every subset of channels, and pairs of values of all other factors."""

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain, combinations, product
from pathlib import Path
from typing import Any

from bench.inputs.bags import CHANNELS, COMMANDS, SENSORS, STAMPS, bag_of
from bench.inputs.outcome import Outcome, Work, call, limit_child
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.excitation import KINDS
from rsea_ros.model.rig_file import load_rig, rig_folders

BAG_VERBS = ("identify", "diagnose", "predict", "check")
SUBSETS = tuple(chain.from_iterable(combinations(CHANNELS, k) for k in range(len(CHANNELS) + 1)))
FIRST = 1_000_000_000
"""ns, the epoch of a clock that began with the machine."""
TRIED = 40
"""Random candidates for each case: more of them make the design a little smaller."""
Case = dict[str, Any]
ROUND_FIGURES = 1_700_000_000_000_000_000
"""ns, an epoch as a recorder has it."""


RIGS = sorted({f.stem for folder in rig_folders() for f in folder.glob("*.yaml")})
FACTORS: dict[str, list[Any]] = {
    "rig": RIGS, "verb": list(BAG_VERBS), "channels": list(SUBSETS),
    "sensors": ["stated", "stated", "zero", "left out", "mixed"],
    "noise": [True, True, False],
    "bench": ["as stated", "misfit"],
    "rate": [280.0] * 15 + [1.0, 5.0, 50.0, 1000.0, 2000.0],
    "states": [1.0] * 6 + [0.2, 0.9, 4.0],
    "duration": [5.0] * 6 + [12.0] * 12 + [30.0] * 3 + [2.0, 90.0, 600.0],
    "command": [*COMMANDS, "white_noise", "chirp", "white_noise"],
    "stamps": [*STAMPS, *["even"] * 12],
    "dead": [*SENSORS, *["none"] * 16],
    "loop": [False, True], "json": [False, True], "epoch": [FIRST, ROUND_FIGURES],
    "storage": [".mcap", ".mcap", "", ".db3"],
}  # fmt: skip
"""What varies from bag to bag; common values stand several times."""


def bag_cases(seed: int, quick: bool) -> tuple[list[Case], str]:
    """Return the cases that play a bag, and a sentence on what they cover."""
    rng = random.Random(seed)
    whole = {"stamps": "even", "dead": "none"}
    rigid = {name for name in RIGS if load_rig(name).rigid_spring}
    must = [
        {"rig": r, "verb": v, "channels": c, **whole} for r, v, c in product(RIGS, BAG_VERBS, SUBSETS)
        if not (r in rigid and "deflection" in c)
    ]  # fmt: skip
    cases, pairs = cover_pairs(FACTORS, rng, must)
    said = f"each of {len(must)} rigs × verbs × subsets of channels; {pairs} pairs of {len(FACTORS)} factors"
    rng.shuffle(cases)
    if quick:
        cases = [c for c in cases if c["duration"] <= 12.0 and c["rate"] <= 280.0][:60]
    return cases, said


def samples(case: Case) -> float:
    """Return the number of samples of the longest channel of a case, or a stand-in for it."""
    return float(case.get("rate", 1.0) * case.get("duration", 1.0) * max(1.0, case.get("states", 1.0)))


def expense(case: Case) -> tuple[bool, float]:
    """Return a key that sorts cases by their cost, so that an interrupted run has played the most."""
    return case["verb"] == "control", samples(case)


def play_bag(case: Case, folder: Path) -> Outcome:
    """Make the bag of a case and run its verb on it."""
    bag, rig = bag_of(case, folder)
    limit_child(case["verb"])
    verb, out = case["verb"], folder / "results"
    arguments = [verb, *([str(rig), str(bag)] if verb == "predict" else [str(bag), "--rig", str(rig)])]
    if verb in ("identify", "diagnose"):
        arguments += ["--out", str(out)]
    elif verb == "predict":
        arguments += ["--out", str(folder / "results.csv")]
    outcome = call([*arguments, *(["--json"] if case["json"] or verb == "predict" else [])])
    if outcome.kind == "result" and verb in ("identify", "diagnose") and not (out / "report.html").exists():
        return Outcome("message", "a result without its report", outcome.detail)
    return outcome


def other_cases(seed: int, quick: bool) -> list[Case]:
    """Return the cases of the verbs that take a rig, numbers, or a table."""
    rng = random.Random(seed)
    simulate = cover_pairs(
        {"rig": RIGS, "verb": ["simulate"], "excitation": sorted(KINDS),
         "rate": [280.0, 1.0, 10.0, 1000.0, 2000.0],
         "duration": [10.0, 2.0, 0.001, 60.0], "effect": [None, *catalogue()],
         "amplitude": [20.0, 0.0, -5.0, 1e-300],
         "period": [4.0, 0.001, 10.0, 1e9], "low": [0.05, 1e-9, 100.0], "high": [100.0, 1e-3, 1e9],
         "no_noise": [False, True]}, rng)[0]  # fmt: skip
    control = cover_pairs({"verb": ["control"], "rig": RIGS, "rate": [280.0, 1000.0, 50.0, 2000.0, 10000.0],
                        "free": [None, *RIGS]}, rng)[0]  # fmt: skip
    export = [{"verb": "export", "rig": r} for r in RIGS]
    odd = [1e-300, 1e-3, 1.0, 1e3, 1e300, 0.0, -1.0, "nan", "inf"]
    options = ("torque", "bandwidth", "inertia", "mass", "diameter", "separation", "spring-radius",
               "deflection", "tolerance-db", "tolerance-deg", "stiffness")  # fmt: skip
    design = [{"verb": "design", "option": o, "value": v} for o in options for v in odd]
    design += [{"verb": "design", "option": "tolerance-deg", "value": v} for v in (89.9, 90, 90.1, 180)]
    groups = [simulate, control, export, design]
    if quick:
        groups = [rng.sample(g, min(len(g), n)) for g, n in zip(groups, (12, 2, 3, 8), strict=True)]
    return [case for group in groups for case in group]


def play_other(case: Case, folder: Path) -> Outcome:
    """Run a verb that takes a rig or numbers."""
    limit_child()
    return call(_ARGUMENTS[case["verb"]](case, folder))


def _simulate(case: Case, folder: Path) -> list[str]:
    numbers = [f"--{n}={case[n]!r}" for n in ("rate", "duration", "amplitude", "period", "low", "high")]
    effect = [f"--effect={case['effect']}"] if case["effect"] else []
    return ["simulate", case["rig"], "--out", str(folder / "bag.mcap"), "--excitation", case["excitation"],
            *numbers, *effect, *(["--no-noise"] if case["no_noise"] else [])]  # fmt: skip


def _control(case: Case, folder: Path) -> list[str]:
    free = ["--free", case["free"]] if case["free"] else []
    return ["control", case["rig"], *free, f"--rate={case['rate']!r}", "--out", str(folder / "out"), "--json"]


_ARGUMENTS: Mapping[str, Callable[[Case, Path], list[str]]] = {
    "simulate": _simulate,
    "control": _control,
    "export": lambda c, f: ["export", "--mjcf", c["rig"], "--no-play", "--out", str(f / "rig.xml")],
    "design": lambda c, f: ["design", f"--{c['option']}={c['value']}", "--out", str(f / "out"), "--json"],
}


def works(cases: Sequence[Case], play: Callable[[Case, Path], Outcome]) -> Iterator[tuple[str, Work]]:
    """Yield name and work of each case; the name is the case in one line, which `--only` can search."""
    for case in cases:
        texts = {k: "+".join(v) or "command alone" if k == "channels" else v for k, v in case.items()}
        name = " ".join(f"{k}={v}" for k, v in texts.items())
        yield name, lambda folder, case=case, name=name: iter([(name, partial(play, case, folder))])


def cover_pairs(
    factors: Mapping[str, Sequence[Any]], rng: random.Random, must: Sequence[Case] = ()
) -> tuple[list[Case], int]:
    """Return few cases in which every two values of any two factors meet, and how many pairs that are.

    must: cases of which some values are given; each is filled up so that it brings new pairs.
    Sizes matter: a value that stands twice in a factor is drawn twice as often, a rare one seldom.
    """
    names = list(factors)
    left = {(a, x, b, y) for a, b in combinations(names, 2) for x in factors[a] for y in factors[b]}
    total, cases, waiting = len(left), [], list(must)

    def pairs(case: Case) -> set[tuple[str, Any, str, Any]]:
        return {(a, case[a], b, case[b]) for a, b in combinations(names, 2)}

    while waiting or left:
        a, x, b, y = min(left, key=repr) if left else ("", None, "", None)
        given = waiting.pop() if waiting else {a: x, b: y}
        drawn = [{n: given.get(n, rng.choice(factors[n])) for n in names} for _ in range(TRIED)]
        cases.append(max(drawn, key=lambda case: len(pairs(case) & left)))
        left -= pairs(cases[-1])
    return cases, total
