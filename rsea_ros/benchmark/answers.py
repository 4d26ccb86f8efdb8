"""A submission to the benchmark: JSON lines, one for each record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rsea_ros.benchmark.dataset import Dataset, json_object, read_text, text_of
from rsea_ros.documents.wording import did_you_mean
from rsea_ros.errors import BenchmarkError


@dataclass(frozen=True)
class Answer:
    """The probability of each named effect, 0 to 1, and the seconds that the answer took, 0 if not stated."""

    causes: Mapping[str, float] = field(default_factory=dict)
    seconds: float = 0.0

    def line(self, record: str) -> dict[str, Any]:
        """Return the line of a submission as an object."""
        causes = [{"name": n, "probability": p} for n, p in self.causes.items()]
        return {"record": record, "causes": causes, "seconds": self.seconds}


def read_answers(path: Path, dataset: Dataset) -> dict[str, Answer]:
    """Return the answer to each record of a data set; one that is missing or late names no effect.

    Raises BenchmarkError with file and line for a record or an effect that the data set lacks, a second
    answer to a record, and a probability outside 0 to 1.
    """
    answers: dict[str, Answer] = {}
    for number, line in enumerate(read_text(path).splitlines(), 1):
        if not line.strip():
            continue
        where = f"{path}: line {number}"
        body = json_object(line, where)
        name = body.get("record")
        if not isinstance(name, str) or name not in dataset.hashes:
            raise BenchmarkError(f"{where}: record = {text_of(name)}, expected one of {dataset.manifest}")
        if name in answers:
            raise BenchmarkError(f"{where}: a second answer to {name}, expected one")
        answer = Answer(_causes(body.get("causes"), dataset, where), _seconds(body, where))
        answers[name] = answer if answer.seconds <= dataset.limit else Answer(seconds=answer.seconds)
    if not answers:
        raise BenchmarkError(f"{path}: no answer, expected one JSON object a line")
    return {name: answers.get(name, Answer()) for name in dataset.hashes}


def _causes(value: Any, dataset: Dataset, where: str) -> dict[str, float]:
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        form = '[{"name": …, "probability": …}]'
        raise BenchmarkError(f"{where}: causes = {text_of(value)}, expected {form}")
    causes: dict[str, float] = {}
    for item in value:
        name, probability = item.get("name"), item.get("probability")
        if name not in dataset.effects:
            near = did_you_mean(str(name), dataset.effects)
            raise BenchmarkError(f"{where}: name = {text_of(name)}, expected an effect of the manifest{near}")
        if name in causes:
            raise BenchmarkError(f"{where}: {name} twice, expected each effect once")
        if not _is_number(probability) or not 0.0 <= probability <= 1.0:
            raise BenchmarkError(f"{where}: probability = {text_of(probability)}, expected 0 to 1")
        causes[name] = float(probability)
    return causes


def _seconds(body: Mapping[str, Any], where: str) -> float:
    seconds = body.get("seconds", 0.0)
    if not _is_number(seconds) or not seconds >= 0.0:
        raise BenchmarkError(f"{where}: seconds = {text_of(seconds)}, expected a number >= 0")
    return float(seconds)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
