"""Records of the cause-naming benchmark, by the plant of test/independent: `rsea benchmark make`.

That plant shares no code with the model or the effects of the project. What a record hides follows from the
text of a seed; the seed of a hidden half is in a file that is not in the repository.
"""

import hashlib
import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from independent.bench import Bench, drawn_bench, record_command
from independent.hidden import BESIDE_THE_CONTRACT, CATALOGUE as CONTRACT, OFF_CATALOGUE
from independent.severities import SEVERITIES, drawn_parameters

sys.path.append(str(Path(__file__).resolve().parents[2]))  # `rsea benchmark make` runs this file

from bench.diagnosis.cases import RIG, hide_all, newer_parameters
from bench.diagnosis.commands import COMMANDS
from rsea_extras.benchmark.dataset import COLUMNS, LIMIT, MANIFEST, VERSION, truth_path
from rsea_extras.benchmark.scoring import RecordTruth, truth_hash
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.model.rig_file import load_rig, rig_text
from rsea_ros.outputs.files import Destination, NewFiles, check_free, write_file
from rsea_ros.progress import Progress
from rsea_ros.records.record import UNITS, FloatArray, Record

GROUPS = {
    (0, False): 0.10, (1, False): 0.35, (2, False): 0.20, (3, False): 0.10, (0, True): 0.12, (1, True): 0.13,
}  # fmt: skip
"""Share of the records by how many effects of the list are hidden, and whether a law beyond it is."""
TRIES = 100
"""Draws of effects until every one of a record shows; most records take one or two."""


RULES = (
    "Use anything in this folder, any software and any knowledge of physics; not the truth file, its seed, "
    "or records made with that seed.",
    "Tune on data sets of other seeds, never on the one that is scored; no hand work on single records.",
    "Name effects of `effects` with the probability that the record hides each; an effect that is not named "
    "has the probability 0. An effect counts as named from a probability of 0.5.",
    "Every hidden effect changes some channel by at least its noise, RMS. A record may hide none, or a law "
    "that is not in `effects`: then the other effects that it hides are right, and nothing else.",
    "The values of the rigs are off: inertia up to 15 %, damping 10 %, stiffness 3 %. That is no effect.",
    f"{LIMIT:g} s for a record on two cores. A record without an answer, or one that took longer, counts as "
    "answered with no effect.",
    "Equal probabilities share the mean of their ranks.",
)


def table_text(record: Record) -> str:
    """Return a record's table."""
    stamps = {"t_command": record["command"].t, "t": record["ft"].t}
    columns = [stamps[n] if n in stamps else record[n].y for n in COLUMNS]
    rows = (",".join(f"{value:.12g}" for value in row) for row in np.column_stack(columns))
    return "\n".join([",".join(COLUMNS), *rows]) + "\n"


def manifest_text(hashes: Mapping[str, str], effects: Mapping[str, str]) -> str:
    """Return the manifest. effects: what each does, by name."""
    units = {n: UNITS.get(n, "s") for n in COLUMNS}
    contents = {
        "schema": 1,
        "benchmark": "cause naming of rotary series elastic actuators",
        "version": VERSION,
        "licence": "BSD-3-Clause, The rsea_ros authors",
        "seconds": LIMIT,
        "columns": units,
        "holds": "a command acts from its stamp to the next; measurements are taken at theirs",
        "effects": dict(effects),
        "rules": list(RULES),
        "records": dict(hashes),
    }
    return json.dumps(contents, indent=1) + "\n"


def truth_text(truths: Mapping[str, RecordTruth]) -> str:
    """Return the truth file."""
    records = {name: truth.document for name, truth in truths.items()}
    return json.dumps({"schema": 1, "records": records}, indent=1) + "\n"


@dataclass(frozen=True)
class Hidden:
    """What a record hides: effects with parameters, and a law outside the list with its relative size."""

    effects: Mapping[str, Mapping[str, float]]
    outside: tuple[str, float] | None = None

    def within(self, bench: Bench) -> Bench:
        """Return a bench that has it."""
        return hide_all(bench, self.effects, self.outside)

    def without(self, name: str) -> "Hidden":
        """Return what is left without one effect."""
        return replace(self, effects={n: p for n, p in self.effects.items() if n != name})


def write(folder: Path, count: int, duration: float, seed: str, tell: Progress) -> Path:
    """Write a data set and, beside its folder, the truth; return the truth's path."""
    truth_file = truth_path(folder)
    check_free([folder, truth_file])
    rig = rig_text(load_rig(RIG))
    truths: dict[str, RecordTruth] = {}
    with NewFiles(Destination(folder)) as new:
        for number in range(1, count + 1):
            name = f"r{number:04d}"
            tell(name, (number - 1) / count)
            record, truths[name] = make_record(seed, number, duration)
            new.write(f"{name}.csv", table_text(record))
            new.write(f"{name}.yaml", rig)
        effects = {name: effect.about for name, effect in catalogue().items()}
        hashes = {name: truth_hash(name, truth) for name, truth in truths.items()}
        new.write(MANIFEST, manifest_text(hashes, effects))
    return write_file(truth_file, truth_text(truths))


def make_record(seed: str, number: int, duration: float) -> tuple[Record, RecordTruth]:
    """Return a record (duration in s) and what it hides."""
    digest = hashlib.sha256(f"rsea cause naming {VERSION}:{number}:{seed}".encode())
    rng = np.random.default_rng(int.from_bytes(digest.digest()))
    salt = hashlib.sha256(digest.digest()).hexdigest()
    excitation = COMMANDS[str(rng.choice(list(COMMANDS)))]
    clean, noise_seed = drawn_bench(rng), int(rng.integers(2**63))
    groups = list(GROUPS)
    group = groups[int(rng.choice(len(groups), p=list(GROUPS.values())))]
    for _ in range(TRIES):
        hidden = _draw(*group, rng)
        bench = hidden.within(clean)
        command = excitation(bench, duration, rng)
        record = _record(bench, command, noise_seed)
        shown = {
            name: times_noise(record, _record(hidden.without(name).within(clean), command, noise_seed))
            for name in hidden.effects
        }
        if all(times >= 1.0 for times in shown.values()):
            outside = hidden.outside[0] if hidden.outside else ""
            return replace(record, source=""), RecordTruth(hidden.effects, outside, shown, salt)
    raise AssertionError(f"record {number}: no draw of {TRIES} shows")


def _record(bench: Bench, command: FloatArray, noise_seed: int) -> Record:
    return record_command(bench, command, np.random.default_rng(noise_seed))


def times_noise(record: Record, other: Record) -> float:
    """Return the largest RMS difference of a channel over its noise; both have the same noise."""
    sensors = load_rig(RIG).sensors
    noises = {n: float(np.hypot(s.noise, s.quantum / np.sqrt(12.0))) for n, s in sensors.items()}
    rms = {n: float(np.sqrt(np.mean((record[n].y - other[n].y) ** 2))) for n in noises}
    return max(rms[n] / noises[n] for n in noises)


def _draw(count: int, has_outside: bool, rng: np.random.Generator) -> "Hidden":
    """Draw what a record hides: at most one effect at each place of the chain."""
    effects = catalogue()
    outside = None
    if has_outside:
        outside = (str(rng.choice(list(OFF_CATALOGUE))), float(rng.uniform(0.6, 1.8)))
    mimics = OFF_CATALOGUE[outside[0]][1] if outside else ()
    chosen: dict[str, Mapping[str, float]] = {}
    for name in rng.permutation(sorted({*CONTRACT, *BESIDE_THE_CONTRACT} - set(mimics))):
        places = {effects[n].port for n in chosen}
        if len(chosen) < count and effects[name].port not in places:
            chosen[str(name)] = _parameters(str(name), rng)
    return Hidden(chosen, outside)


def _parameters(name: str, rng: np.random.Generator) -> Mapping[str, float]:
    """Return parameters of an effect of random size, in the catalogue's units."""
    if name in CONTRACT:
        return drawn_parameters(name, str(rng.choice(SEVERITIES)), rng)
    return newer_parameters(name, float(rng.uniform(0.6, 1.8)))
