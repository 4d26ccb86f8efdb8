"""The records whose diagnosis is frozen, by set: how each is made, so that only one is in memory."""

import importlib
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np

from bench import SHARED
from bench.diagnosis.cases import plan, shared_records
from bench.diagnosis.played import Entry, Played
from msg_adapters.tables import import_record, load_map
from rsea_ros.cli.maps import map_path
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record

SMALL_SECONDS, LAB_SECONDS = 8.0, 30.0


def bench_records(seed: int = 2024, duration: float | None = None) -> Iterator[Entry]:
    """Yield the records of the diagnosis bench: of the second bench. duration: s, in place of their own."""
    for number, case in enumerate(plan(seed)):
        yield Entry(f"bench/{number:03d}-{case.name}", partial(case.make, False, duration))


def case_records() -> Iterator[Entry]:
    """Yield the recorded bags of ../shared/cases."""
    for entry in shared_records():
        yield Entry(f"cases/{entry.name.removeprefix('shared-')}", entry.make)


REAL: Mapping[str, tuple[str, Sequence[str]]] = {
    "emps_identification": ("emps", ["emps/DATA_EMPS.mat"]),
    "cycloidal_short_ramps": ("cycloidal", [
        f"cycloidal/2024-07-{name}.csv.gz" for name in (
            "18__10-58-26__torqueramp__base_onyx_runin1", "18__11-02-28__torqueramp__base_onyx_runin5",
            "18__16-28-57__torqueramp__split_onyx_runin1", "19__12-45-43__torqueramp__split_onyx_12pre1",
            "19__13-53-23__torqueramp__conic_onyx_2pre1",
        )
    ]),
    "pendulum": ("pendulum", [
        "pendulum/gravity_compensation.measured.csv.gz", "pendulum/ddp.measured.csv.gz",
        "pendulum/pd__system_identification.measured.csv.gz",
    ]),
    "sea_gamma": ("sea_two_encoders", [
        f"sea_gamma/{name}.csv" for name in (
            "open_0.5_1_7", "open_1_1_13", "open_3_1_25", "open_3_2_26", "open_5_1_31", "closed_0.25_1",
        )
    ]),
}  # fmt: skip
"""By map: rig and files of ../shared/realdata."""


def real_records() -> Iterator[Entry]:
    """Yield the measurements of real machines that have a map and a rig in the library."""
    for name, (rig, files) in REAL.items():
        for file in files:
            short = Path(file).name.split(".measured")[0].removesuffix(".csv.gz").removesuffix(".csv")
            yield Entry(f"realdata/{name}-{short}", partial(_of_machine, file, name, rig))


def _of_machine(file: str, name: str, rig: str) -> Played:
    return Played(import_record(SHARED / "realdata" / file, load_map(map_path(name))), load_rig(rig))


@cache
def plant(name: str) -> ModuleType:
    """Return a generator of ../shared/plants as a module."""
    folder = str(SHARED / "plants")
    if folder not in sys.path:
        sys.path.append(folder)  # by its own name, under which numba keeps what it compiled
    return importlib.import_module(name)


def small_records(seed: int, seconds: float = SMALL_SECONDS, rate: int = 1000) -> Iterator[Entry]:
    """Yield the records of the small actuator, a law each. rate: Hz."""
    if (SHARED / "plants" / "small.py").exists():
        laws = plant("small")
        for name in (*laws.KNOWN, *laws.UNKNOWN):
            yield Entry(f"plants/small-{seed}-{name}", partial(_of_small, name, seed, seconds, rate))


def _of_small(name: str, seed: int, seconds: float, rate: int) -> Played:
    laws = plant("small")
    cause, law, _ = laws.KNOWN[name] if name in laws.KNOWN else (None, laws.UNKNOWN[name], {})
    own = seed + sum(map(ord, name))
    t, command, at, *channels = laws.simulate(law, own, seconds, rate)
    names = ("position", "velocity", "motor_torque", "ft")
    measured = {n: Channel(at, np.asarray(y)) for n, y in zip(names, channels, strict=True)}
    record = Record({"command": Channel(t, command), **measured}, source=name)
    with TemporaryDirectory() as folder:
        laws.rigfile(Path(folder) / "rig.yaml", np.random.default_rng([own, 5]))
        rig = load_rig(str(Path(folder) / "rig.yaml"))
    cause = "viscoelastic_spring" if name == "maxwell" else cause  # which its maker still calls unknown
    truth = () if cause in (None, "nothing") else (cause,)
    return Played(record, rig, (), truth)


def lab_records(seed: int, seconds: float = LAB_SECONDS) -> Iterator[Entry]:
    """Yield the records of the knee bench: its stiffness known within a tenth."""
    if (SHARED / "plants" / "lab.py").exists():
        for name in plant("lab").CASES:
            yield Entry(f"plants/lab-{seed}-{name}", partial(_of_lab, name, seed, seconds))


def _of_lab(name: str, seed: int, seconds: float) -> Played:
    lab = plant("lab")
    law, truth = lab.CASES[name]
    if "plate" in law:  # an inertia on a spring at the clamped end, not a mode beside it: `base_compliance`
        truth = ("base_compliance",)
    number = list(lab.CASES).index(name)
    with TemporaryDirectory() as folder:
        table, rig, mapping = (Path(folder) / n for n in (f"{name}.csv", "lab.yaml", "map.yaml"))
        lab.write(str(table), *lab.bench(seed=100 * seed + number, T=seconds, **law))
        rig.write_text(lab.RIG % (300.0, 0.1))
        mapping.write_text(lab.MAP)
        return Played(import_record(table, load_map(mapping)), load_rig(str(rig)), (), tuple(truth))


def generated(folder: Path, seeds: Iterable[int]) -> Iterator[Entry]:
    """Yield the records of every module of a folder that makes some.

    `cases(seed)` yields names and the causes hidden; `make(name, seed, folder)` writes record.csv, map.yaml
    and rig.yaml there.
    """
    sys.path.append(str(folder.resolve()))
    for module in map(importlib.import_module, sorted(path.stem for path in folder.glob("*.py"))):
        for seed in seeds:
            for name, truth in module.cases(seed):
                make = partial(_of_generator, module, name, seed, truth)
                yield Entry(f"{module.__name__}-{seed}/{name}", make)


def _of_generator(module: ModuleType, name: str, seed: int, truth: Sequence[str]) -> Played:
    with TemporaryDirectory() as made:
        module.make(name, seed, made)
        table, maps, rig = (Path(made) / n for n in ("record.csv", "map.yaml", "rig.yaml"))
        return Played(import_record(table, load_map(maps)), load_rig(str(rig)), (), tuple(truth))


def plant_records() -> Iterator[Entry]:
    """Yield 60 and more records of the plants of other hands."""
    yield from small_records(101)
    for seed in (201, 202, 203, 204):
        yield from lab_records(seed)
    yield from (e for k, e in enumerate(small_records(102)) if k % 6 == 0)


def quick_records() -> Iterator[Entry]:
    """Yield the subset of at most three minutes: a few of every set, alike from run to run."""
    yield from _spread(list(small_records(101)), 8)
    yield from _spread(list(lab_records(201)), 2)
    yield from _spread(list(case_records()), 3)
    yield from _spread(list(bench_records(duration=12.0)), 6, "quick")


def _spread(entries: Sequence[Entry], count: int, name: str = "") -> Iterator[Entry]:
    """Yield some entries, evenly spread over all. name: of their set, where they differ from it."""
    for k in range(count if entries else 0):
        entry = entries[math.floor((k + 0.5) * len(entries) / count)]
        yield Entry(f"{name}/{entry.name.split('/', 1)[1]}" if name else entry.name, entry.make)


SETS: Mapping[str, Callable[[], Iterator[Entry]]] = {
    "quick": quick_records, "cases": case_records, "realdata": real_records, "plants": plant_records,
    "bench": bench_records,
}  # fmt: skip
"""By name: the entries of a set. `quick` is the subset that is played after a change."""
