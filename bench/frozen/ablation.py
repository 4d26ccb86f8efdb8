"""Each special branch of the diagnosis switched off in turn: where does it decide, and is it right there?

A branch stands here as a function of the package and what it returns where the branch does nothing. A first
run of a record notes which branches ever do something. Only those are played again without: the others cannot
change a number.
"""

import contextlib
import importlib
import itertools
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from bench.diagnosis.played import Entry, Line, play as diagnosed, said, verdict_on
from bench.frozen.cases import bench_records, lab_records, small_records
from bench.frozen.play import KEPT
from bench.results import Row, append_line, read_lines
from rsea_ros.diagnosis.candidate import Candidate
from rsea_ros.diagnosis.settings import DEFAULT, DiagnosisSettings
from rsea_ros.diagnosis.stepwise import ReducedModels

Off = Callable[..., Any]
_WITH = ReducedModels._with


class Branch(NamedTuple):
    """A branch: its functions, `module:attribute` below rsea_ros.diagnosis, and what each does when off.

    setting: what switches it off, in place of functions.
    acts: whether a call does something, of its result and arguments, where the call without is too dear; of
    the function `noted` where a setting switches the branch off.
    """

    functions: Mapping[str, Off] = {}
    setting: tuple[str, str, Any] | None = None
    acts: Callable[..., bool] | None = None
    noted: str = ""


def _nothing(*_args: Any, **_kwargs: Any) -> list[Any]:
    return []


def _no(*_args: Any, **_kwargs: Any) -> bool:
    return False


def _fitted_on(self: ReducedModels, model: Candidate, *rest: Any) -> Candidate | None:
    """Return a model with a rival in the place of a cause, fitted to the end also where it is far."""

    def is_far(owner: ReducedModels, m: Candidate) -> bool:
        return m is model and ReducedModels._is_far(owner, m)

    patient = type("Patient", (ReducedModels,), {"_is_far": is_far})
    mine = (self.effects, self.pools, self.settings, self.fitted)
    return _WITH(patient(*mine), model, *rest)


def _was_dropped(result: Candidate | None, self: ReducedModels, model: Candidate, *_: Any) -> bool:
    return result is not None and self._is_far(result) and not self._is_far(model)


FITS, FORWARD = "step_fits:StepFits", "stepwise:ForwardStep"
BRANCHES: Mapping[str, Branch] = {
    "ripple on the measured angle": Branch({f"{FITS}.on_measured_angle": _nothing}),
    "starts from stated values": Branch({f"{FITS}._from_stated_values": _nothing}),
    "pairs": Branch({f"{FORWARD}._pairs": _nothing}),
    "pairs nearer the rig": Branch({f"{FORWARD}._pairs_nearer_the_rig": _nothing}),
    "a tenth of the guess": Branch({"step_fits:_other_guesses": _nothing}),
    "common clock into the delay": Branch({"candidate:with_clocks_in_delay": lambda solution: None}),
    "quick replacement dropped": Branch(
        {"stepwise:ReducedModels._with": _fitted_on}, acts=_was_dropped),
    "close rivals fitted to the end": Branch(
        {"naming.weighing:_beside_all_causes": lambda tried, *_: tried}),
    "wandering sensor (carried)": Branch(
        setting=("naming", "carried", math.inf), noted="naming.status:probabilities_and_status",
        acts=lambda _, every, *__: every[0].signature.carried > DEFAULT.naming.carried),
    "size open by ten": Branch({"naming.conclusion:is_known": lambda size, rule: True}),
    "rig doubtful": Branch({"naming.weighing:is_off_rig": _no}),
    "known values that pay": Branch({"criteria:keeps_known_values": _no}),
    "play remark": Branch({"naming.conclusion:undetermined_play": lambda *_: ()}),
    "missed response by coherence": Branch({"score:missed_response": lambda *_: 0.0}),
}  # fmt: skip
"""By the names of the list in the issue that asked for the table."""


@contextlib.contextmanager
def replaced(functions: Mapping[str, Callable[[Off], Off]]) -> Iterator[None]:
    """Replace functions of the diagnosis by what is made of them within a with statement."""
    with contextlib.ExitStack() as stack:
        for place, make in functions.items():
            module, name = place.split(":")
            *owner, attribute = name.split(".")
            target: Any = importlib.import_module(f"rsea_ros.diagnosis.{module}")
            for part in owner:
                target = getattr(target, part)
            before = getattr(target, attribute)
            stack.callback(setattr, target, attribute, before)
            setattr(target, attribute, make(before))
        yield


def _without(branch: Branch) -> contextlib.AbstractContextManager[None]:
    return replaced({place: lambda _, off=off: off for place, off in branch.functions.items()})


def _settings(branch: Branch) -> DiagnosisSettings:
    if branch.setting is None:
        return DEFAULT
    group, name, value = branch.setting
    return replace(DEFAULT, **{group: replace(getattr(DEFAULT, group), **{name: value})})


@contextlib.contextmanager
def _noting(acts: Counter[str]) -> Iterator[None]:
    """Count how often each branch does something within a with statement."""

    def noted(name: str, off: Off) -> Callable[[Off], Off]:
        does = BRANCHES[name].acts or (lambda result, *args: not _same(result, off(*args)))

        def make(before: Off) -> Off:
            def call(*args: Any, **kwargs: Any) -> Any:
                result = before(*args, **kwargs)
                acts[name] += does(result, *args)
                return result

            return call

        return make

    places = {p: noted(n, off) for n, b in BRANCHES.items() for p, off in b.functions.items()}
    places |= {b.noted: noted(n, _no) for n, b in BRANCHES.items() if b.noted}
    with replaced(places):
        yield


def _same(a: Any, b: Any) -> bool:
    """Return whether two results are one: the same objects, in the same order."""
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return a is b or (isinstance(a, bool | float | str) and a == b)


def play(entry: Entry) -> Iterator[dict[str, Any]]:
    """Yield a line of a record as it is, then one without each branch that does something on it."""
    played = entry.make()
    acts: Counter[str] = Counter()
    with _noting(acts):
        first = diagnosed(entry.name, played)
    yield {**first, "branch": "", "acts": dict(acts)}
    for name in (n for n in BRANCHES if acts[n]):
        with _without(BRANCHES[name]):
            yield {**diagnosed(entry.name, played, _settings(BRANCHES[name])), "branch": name}


def records() -> Iterator[Entry]:
    """Yield the records of the table: more than half from plants of other hands, no set in a row."""
    small = list(small_records(311, 5.0, 500))
    lab = [e for seed in (312, 313) for e in lab_records(seed, 10.0)]
    own = [e for e in bench_records(2031, 10.0) if not e.name.split("-")[1].startswith(("clean", "fault"))]
    mixed = [own[(k * 37) % len(own)] for k in range(30)]
    plants, own_ones = iter(small), iter(mixed)
    every = (plants, own_ones, plants, iter(lab), own_ones)
    for turn in itertools.islice(itertools.cycle(every), 5 * len(small)):
        entry = next(turn, None)
        if entry is not None:
            yield entry


def main(*, log: Path = KEPT / "ablation.jsonl", minutes: float = math.inf) -> Iterator[Row | str]:
    """Play the records that the log lacks, and print the table.

    log: a line of JSON each
    minutes: begin no record after that; 0: only the table of the log
    """
    stop = time.monotonic() + 60.0 * minutes
    done = {line["record"] for line in read_lines(log) if line["branch"] == "end"}
    left = [entry for entry in records() if entry.name not in done] if minutes else []
    if left:
        diagnosed("", left[0].make())  # loads what is compiled: no record's time holds that
    for entry in itertools.takewhile(lambda _: time.monotonic() < stop, left):
        for line in (*play(entry), {"record": entry.name, "branch": "end"}):
            append_line(log, line)
        yield entry.name
    yield from table(read_lines(log))


def is_right(line: Line, truth: Sequence[str] | None) -> bool:
    """Return whether no wrong name is told as sure, and every hidden cause is named where there is one."""
    verdict = verdict_on({**line, "truth": truth})
    return not verdict.surely_wrong and not verdict.missed


def table(lines: Iterable[Line]) -> Iterator[Row]:
    """Yield for each branch how often it acts and decides, what is right with and without, and its cost."""
    by_record: dict[str, dict[str, Line]] = {}
    for line in lines:
        by_record.setdefault(line["record"], {})[line["branch"]] = line
    whole = {name: played for name, played in by_record.items() if "end" in played}
    for name in BRANCHES:
        yield Row(name, "", _counts([(p[""], p[name]) for p in whole.values() if name in p]))
    others = sum(n.startswith("plants") for n in whole)
    yield Row("*records played; from ../shared/plants*", "", _cells(f"{len(whole)}; {others}"))


def _cells(acts: str, decides: str = "", right: str = "", number: str = "", processor: str = "") -> Any:
    return {"acts on": acts, "decides on: name, status, verdict": decides, "right with; without": right,
            "only a number": number, "processor, %": processor}  # fmt: skip


def _counts(pairs: Sequence[tuple[Line, Line]]) -> Any:
    decided = [(a, b) for a, b in pairs if said(a) != said(b)]
    moved = sum(a["digest"] != b["digest"] or a["remarks"] != b["remarks"] for a, b in pairs) - len(decided)
    kinds = Counter(kind for a, b in decided for kind in _kinds(a, b))
    where = ", ".join(f"{kinds[k]} {k}" for k in ("name", "status", "verdict") if kinds[k])
    right = "; ".join(str(sum(is_right(pair[k], pair[0]["truth"]) for pair in decided)) for k in (0, 1))
    before, after = (sum(pair[k]["processor"] for pair in pairs) for k in (0, 1))
    cost = f"{100.0 * (before / after - 1.0):+.0f}" if after else ""
    told = (f"{len(decided)}: {where}", right) if decided else ("0", "")
    return _cells(str(len(pairs)), *told, str(moved), cost)


def _kinds(a: Line, b: Line) -> Iterator[str]:
    names = [{c["name"]: c["status"] for c in line["causes"]} for line in (a, b)]
    if names[0].keys() != names[1].keys():
        yield "name"
    if any(names[0][n] != names[1][n] for n in names[0].keys() & names[1].keys()):
        yield "status"
    if a["verdict"] != b["verdict"]:
        yield "verdict"
