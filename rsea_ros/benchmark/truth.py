"""What is hidden in the records of a data set, in a file apart, and the hashes that commit to it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rsea_ros.benchmark.dataset import Dataset
from rsea_ros.benchmark.documents import read_json, text_of
from rsea_ros.errors import BenchmarkError


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


def truth_text(truths: Mapping[str, RecordTruth]) -> str:
    """Return the truth file."""
    records = {name: truth.document for name, truth in truths.items()}
    return json.dumps({"schema": 1, "records": records}, indent=1) + "\n"


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
        truth = _truth(body, f"{path}: records.{name}")
        if truth_hash(name, truth) != expected:
            raise BenchmarkError(
                f"{path}: records.{name} has the hash {truth_hash(name, truth)[:12]}…, expected "
                f"{expected[:12]}… of {dataset.manifest}: not the truth that was committed to"
            )
        truths[name] = truth
    return truths


def _truth(body: object, where: str) -> RecordTruth:
    if not isinstance(body, dict):
        raise BenchmarkError(f"{where} is {text_of(body)}, expected an object")
    causes, shows = body.get("causes"), body.get("times_noise")
    values = [*causes.values()] if isinstance(causes, dict) else [None]
    if not all(isinstance(v, dict) for v in (*values, shows)):
        raise BenchmarkError(f"{where}: expected causes and times_noise as objects")
    return RecordTruth(causes, str(body.get("outside", "")), shows, str(body.get("salt", "")))  # type: ignore[arg-type]
