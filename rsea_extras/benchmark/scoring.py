"""Truth, scores of answers against it, and entries: the project's own and baselines."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rsea_extras.benchmark.dataset import Answer, Dataset, read_json
from rsea_ros import Record, Rig
from rsea_ros.extension.base import BenchmarkError, FloatArray, quote
from rsea_ros.extension.recording import best_single_effect, diagnose


@dataclass(frozen=True)
class RecordTruth:
    """What one record hides.

    causes: effects of the list with their parameters, SI. outside: a law that is not in the list, empty for
    none. times_noise: RMS of what each hidden effect changes over the noise, in the channel that shows it
    most. salt: random text; without it nobody can find the truth by hashing guesses.
    """

    causes: Mapping[str, Mapping[str, float]]
    outside: str
    times_noise: Mapping[str, float]
    salt: str

    @property
    def document(self) -> dict[str, object]:
        """The truth for JSON."""
        return {
            "causes": {n: dict(p) for n, p in self.causes.items()},
            "outside": self.outside,
            "times_noise": dict(self.times_noise),
            "salt": self.salt,
        }


def truth_hash(record: str, truth: RecordTruth) -> str:
    """Return the SHA-256 of a record's name and its truth, salt included, as JSON with sorted keys."""
    text = json.dumps([record, truth.document], sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def read_truth(path: Path, dataset: Dataset) -> dict[str, RecordTruth]:
    """Return the truth of every record of a data set.

    Raises BenchmarkError for a record that the file lacks, and where a hash is not the one of the manifest.
    """
    records = read_json(path).get("records")
    truths = {}
    for name, expected in dataset.hashes.items():
        body = records.get(name) if isinstance(records, dict) else None
        if body is None:
            raise BenchmarkError(f"{path}: no records.{name}, expected the truth of {dataset.folder}")
        where = f"{path}: records.{name}"
        if not isinstance(body, dict):
            raise BenchmarkError(f"{where} is {quote(body)}, expected an object")
        causes, shows = body.get("causes"), body.get("times_noise")
        values = [*causes.values()] if isinstance(causes, dict) else [None]
        if not all(isinstance(v, dict) for v in (*values, shows)):
            raise BenchmarkError(f"{where}: expected causes and times_noise as objects")
        truth = RecordTruth(causes, str(body.get("outside", "")), shows, str(body.get("salt", "")))  # type: ignore[arg-type]
        if truth_hash(name, truth) != expected:
            raise BenchmarkError(
                f"{path}: records.{name} has the hash {truth_hash(name, truth)[:12]}…, expected "
                f"{expected[:12]}… of {dataset.manifest}: not the truth that was committed to"
            )
        truths[name] = truth
    return truths


NAMED = 0.5
"""Probability from which an effect counts as named: likelier hidden than not."""
DRAWS, SEED = 2000, 1
"""Of the bootstrap: 2000 draws give the ends of a 95 % interval to about a tenth of its width."""


class ScoreInterval(NamedTuple):
    """A value with its 95 % interval; NaN where no record has it."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Scores:
    """Scores of a submission.

    named_right: share of the hidden effects that are named. false_names: share of the names that are wrong.
    silent: share of the records without a hidden effect of the list in which nothing is named.
    brier: mean over records of the sum over effects of (probability - hidden)^2. rank: median place of a
    hidden effect among those that are not hidden, 1 the first. answered: share of records with any name.
    """

    named_right: ScoreInterval
    false_names: ScoreInterval
    silent: ScoreInterval
    brier: ScoreInterval
    rank: ScoreInterval
    answered: float


@dataclass(frozen=True)
class _Counts:
    """What a record adds to the scores; ranks: of each hidden effect."""

    hidden: int
    right: int
    names: int
    empty: bool
    brier: float
    ranks: tuple[float, ...]


def score(answers: Mapping[str, Answer], truths: Mapping[str, RecordTruth], effects: Sequence[str]) -> Scores:
    """Return the scores of answers to the records of `truths`; effects: the list that can be named."""
    counts = [_counts(answers[name], truth, effects) for name, truth in truths.items()]
    return Scores(
        named_right=_interval(counts, lambda c: _share([x.right for x in c], [x.hidden for x in c])),
        false_names=_interval(counts, lambda c: _share([x.names - x.right for x in c], [x.names for x in c])),
        silent=_interval(counts, _silent_share),
        brier=_interval(counts, lambda c: float(np.mean([x.brier for x in c]))),
        rank=_interval(counts, _median_rank),
        answered=sum(c.names > 0 for c in counts) / len(counts),
    )


def _counts(answer: Answer, truth: RecordTruth, effects: Sequence[str]) -> _Counts:
    probability = np.array([answer.causes.get(n, 0.0) for n in effects])
    hidden = np.array([n in truth.causes for n in effects])
    named = probability >= NAMED
    ranks = tuple(_rank(float(p), probability[~hidden]) for p in probability[hidden])
    brier = float(np.sum((probability - hidden) ** 2))
    empty = not hidden.any()
    return _Counts(int(hidden.sum()), int((named & hidden).sum()), int(named.sum()), empty, brier, ranks)


def _rank(probability: float, others: FloatArray) -> float:
    """Return the place among effects that are not hidden; equal ones share the mean of their places."""
    return 1.0 + float(np.sum(others > probability)) + 0.5 * float(np.sum(others == probability))


def _share(part: Sequence[float], whole: Sequence[float]) -> float:
    return sum(part) / sum(whole) if sum(whole) else float("nan")


def _silent_share(counts: Sequence[_Counts]) -> float:
    return _share([c.empty and not c.names for c in counts], [c.empty for c in counts])


def _median_rank(counts: Sequence[_Counts]) -> float:
    ranks = [r for c in counts for r in c.ranks]
    return float(np.median(ranks)) if ranks else float("nan")


def _interval(counts: Sequence[_Counts], statistic: Callable[[Sequence[_Counts]], float]) -> ScoreInterval:
    rng = np.random.default_rng(SEED)
    drawn = rng.integers(len(counts), size=(DRAWS, len(counts)))
    values = np.array([statistic([counts[k] for k in row]) for row in drawn])
    values = values[np.isfinite(values)]
    low, high = np.percentile(values, (2.5, 97.5)) if len(values) else (float("nan"), float("nan"))
    return ScoreInterval(statistic(counts), float(low), float(high))


def diagnosis_answer(record: Record, rig: Rig) -> Answer:
    """Return the causes of a diagnosis, and their alternatives, with the probabilities that it states."""
    result = diagnose([record], rig)
    rivals = {a.name: a.probability for a in result.alternatives}
    causes = rivals | {c.name: c.probability for c in result.causes}
    return Answer(dict(sorted(causes.items(), key=lambda c: -c[1])))


def largest_gain(record: Record, rig: Rig) -> Answer:
    """Return the effect that leaves least when it is fitted alone to the training blocks, as certain."""
    best = best_single_effect(record, rig)
    return Answer({best: 1.0} if best else {})


ENTRIES = {"diagnose": diagnosis_answer, "largest_gain": largest_gain}
"""Entries by name."""


_RANDOM_SEED = 0


def random_names(dataset: Dataset) -> dict[str, Answer]:
    """Return answers that name one effect of the list at random, as certain."""
    rng = np.random.default_rng(_RANDOM_SEED)
    return {name: Answer({str(rng.choice(dataset.effects)): 1.0}) for name in dataset.hashes}


BASELINES = {"no names": lambda dataset: dict.fromkeys(dataset.hashes, Answer()), "random": random_names}
"""Rows that every table of scores begins with."""
