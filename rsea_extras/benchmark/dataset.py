"""A dataset of records with hidden causes, its documents, and a submission: JSON lines, one a record."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rsea_ros import Record
from rsea_ros.extension.base import BenchmarkError, Channel, did_you_mean, no_utf_8, quote


def read_text(path: Path) -> str:
    """Return the text of a file. Raises BenchmarkError where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise BenchmarkError(f"{path}: {error.strerror}, expected a file that can be read") from None
    except UnicodeDecodeError as error:
        raise BenchmarkError(f"{path}: {no_utf_8(error)}, expected JSON") from None


def read_json(path: Path) -> dict[str, Any]:
    """Return the object of a JSON file."""
    return json_object(read_text(path), str(path))


def json_object(text: str, where: str) -> dict[str, Any]:
    """Return the object that a text is in JSON. Raises BenchmarkError for anything else."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        reason = error.msg if isinstance(error, json.JSONDecodeError) else type(error).__name__
        raise BenchmarkError(f"{where}: {reason}, expected JSON") from None
    if not isinstance(value, dict):
        raise BenchmarkError(f"{where}: {quote(value)}, expected a JSON object")
    return value


VERSION = "1"
"""Of the rules and of the way records are drawn; scores of different versions are not comparable."""
MANIFEST = "manifest.json"
LIMIT = 120.0
"""s for a record on two cores; an answer that took longer counts as none."""
COLUMNS = ("t_command", "command", "t", "ft", "position", "velocity", "motor_torque")
"""Of a record's table: stamps of the command, s, the command, stamps of the measurements, s, and these."""
_NAME = re.compile(r"r[0-9]{4,6}")


@dataclass(frozen=True)
class Dataset:
    """A data set as its manifest states it. hashes: of the truth, by record. limit: s for a record."""

    folder: Path
    hashes: Mapping[str, str]
    effects: tuple[str, ...]
    limit: float

    @property
    def manifest(self) -> Path:
        """The manifest's file."""
        return self.folder / MANIFEST

    @property
    def truth(self) -> Path:
        """Where `make` puts the truth: beside the folder."""
        return truth_path(self.folder)

    def rig_path(self, name: str) -> Path:
        """Return the rig file of a record."""
        return self.folder / f"{name}.yaml"

    def record(self, name: str) -> Record:
        """Return a record. Raises BenchmarkError for a table that is not as COLUMNS say."""
        path = self.folder / f"{name}.csv"
        header, _, rows = read_text(path).partition("\n")
        if tuple(header.strip().split(",")) != COLUMNS:
            raise BenchmarkError(f"{path}: columns {quote(header)}, expected {','.join(COLUMNS)}")
        try:
            table = np.loadtxt(rows.splitlines(), delimiter=",", ndmin=2)
        except ValueError as error:
            raise BenchmarkError(f"{path}: {error}, expected numbers") from None
        if table.shape[0] < 2 or table.shape[1] != len(COLUMNS) or not np.isfinite(table).all():
            raise BenchmarkError(f"{path}: expected at least 2 rows of {len(COLUMNS)} finite numbers")
        columns = dict(zip(COLUMNS, np.ascontiguousarray(table.T), strict=True))
        starts, ends = columns.pop("t_command"), columns.pop("t")
        stamps = {name: starts if name == "command" else ends for name in columns}
        return Record({n: Channel(stamps[n], y) for n, y in columns.items()}, str(path))


def truth_path(folder: Path) -> Path:
    """Return where the truth of a data set lies: beside its folder."""
    return folder.with_name(f"{folder.name}.truth.json")


def read_dataset(folder: Path) -> Dataset:
    """Return the data set in a folder. Raises BenchmarkError for a manifest that is not of this version."""
    path = folder / MANIFEST
    body = read_json(path)
    if body.get("version") != VERSION:
        raise BenchmarkError(f"{path}: version = {quote(body.get('version'))}, expected {VERSION!r}")
    hashes, effects, limit = (body.get(key) for key in ("records", "effects", "seconds"))
    if not isinstance(hashes, dict) or not hashes:
        raise BenchmarkError(f"{path}: records = {quote(hashes)}, expected a hash for each record")
    wrong = [name for name in hashes if not _NAME.fullmatch(name)]
    if wrong:
        raise BenchmarkError(f"{path}: records has {quote(wrong[0])}, expected names such as r0001")
    if not isinstance(effects, dict) or not effects:
        raise BenchmarkError(f"{path}: effects = {quote(effects)}, expected the effects that can be named")
    if not isinstance(limit, (int, float)) or isinstance(limit, bool) or not limit > 0.0:
        raise BenchmarkError(f"{path}: seconds = {quote(limit)}, expected a number > 0")
    return Dataset(folder, hashes, tuple(effects), float(limit))


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
            raise BenchmarkError(f"{where}: record = {quote(name)}, expected one of {dataset.manifest}")
        if name in answers:
            raise BenchmarkError(f"{where}: a second answer to {name}, expected one")
        seconds = body.get("seconds", 0.0)
        if not _is_number(seconds) or not seconds >= 0.0:
            raise BenchmarkError(f"{where}: seconds = {quote(seconds)}, expected a number >= 0")
        answer = Answer(_causes(body.get("causes"), dataset, where), float(seconds))
        answers[name] = answer if answer.seconds <= dataset.limit else Answer(seconds=answer.seconds)
    if not answers:
        raise BenchmarkError(f"{path}: no answer, expected one JSON object a line")
    return {name: answers.get(name, Answer()) for name in dataset.hashes}


def _causes(value: Any, dataset: Dataset, where: str) -> dict[str, float]:
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        form = '[{"name": …, "probability": …}]'
        raise BenchmarkError(f"{where}: causes = {quote(value)}, expected {form}")
    causes: dict[str, float] = {}
    for item in value:
        name, probability = item.get("name"), item.get("probability")
        if name not in dataset.effects:
            near = did_you_mean(str(name), dataset.effects)
            raise BenchmarkError(f"{where}: name = {quote(name)}, expected an effect of the manifest{near}")
        if name in causes:
            raise BenchmarkError(f"{where}: {name} twice, expected each effect once")
        if not _is_number(probability) or not 0.0 <= probability <= 1.0:
            raise BenchmarkError(f"{where}: probability = {quote(probability)}, expected 0 to 1")
        causes[name] = float(probability)
    return causes


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
