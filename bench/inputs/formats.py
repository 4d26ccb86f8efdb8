"""Every format that is read: well-formed files to begin with, the damage to them, and their reader."""

from __future__ import annotations

import gzip
import json
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench.inputs.arrays import damaged_npz, damaged_parquet
from bench.inputs.bag_files import bag_of_views, damaged_mcap, damaged_sqlite
from bench.inputs.bytes_damage import damage_bytes
from bench.inputs.documents import damaged_json, damaged_table, damaged_yaml
from bench.inputs.outcome import REFUSED, RESULT, Outcome, Play, call
from bench.inputs.tables import (
    CSV,
    EXPRESSED,
    LISTED,
    MAP,
    RATED,
    STRUCTS,
    damaged_gzip,
    json_tables,
    mat_files,
    npz_files,
    parquet_files,
    play_import,
    struct_files,
)
from msg_adapters import iterate, read_record, write_record
from rsea_ros.cli.simulate import parse_effect
from rsea_ros.design.motor_gear_units import catalogue
from rsea_ros.effects.catalogue import catalogue as effects
from rsea_ros.errors import RseaError
from rsea_ros.hardware.netft.calibration import parse
from rsea_ros.model.rig_file import load_rig, rig_folders
from rsea_ros.nodes._health_inputs import noise_from
from rsea_ros.records.record import Channel, Record

RIG = "paper_high_impedance"
EVERY = 8
"""One in this many accepted files goes on into a verb that computes with it."""
Damage = Callable[[random.Random, bytes, bytes], bytes]


@dataclass(frozen=True)
class Format:
    """name; seeds: well-formed files; damage: makes another of one; play: reads it, in a folder."""

    name: str
    seeds: Callable[[], Sequence[bytes]]
    damage: Damage
    play: Play


def try_readers(*readers: Callable[[], object]) -> Outcome:
    """Call readers; each may succeed or refuse with an error of the package."""
    refusals = []
    for reader in readers:
        try:
            reader()
        except RseaError as error:
            refusals.append(f"{type(error).__name__}: {error}")
            if not str(error).strip() or "\n" in str(error).strip():
                return Outcome("message", f"no one line: {type(error).__name__}", repr(str(error))[:300])
    return Outcome(REFUSED, "", refusals[0]) if refusals else Outcome(RESULT)


@cache
def _record() -> Record:
    t = np.arange(400) / 280.0
    rng = np.random.default_rng(0)
    names = ("command", "motor_torque", "position", "velocity", "ft")
    return Record(
        {n: Channel(t, rng.standard_normal(400)) for n in names}, epoch_ns=1_700_000_000_000_000_000
    )


@cache
def _bag(suffix: str) -> bytes:
    with TemporaryDirectory() as folder:
        write_record(_record(), Path(folder) / f"bag{suffix}")
        return (Path(folder) / f"bag{suffix}").read_bytes()


def _play_bag(suffix: str) -> Play:
    def play(folder: Path, data: bytes, number: int) -> Outcome:
        bag = folder / f"bag{suffix}"
        bag.write_bytes(data)
        outcome = try_readers(lambda: read_record([bag]), lambda: read_record([bag], strict=False),
                        lambda: sum(1 for _ in iterate([bag])))  # fmt: skip
        if number % EVERY == 0:
            return call([("predict", "identify", "diagnose")[number // EVERY % 3],
                         *([RIG] if number // EVERY % 3 == 0 else []), str(bag),
                         "--out", str(folder / f"out{number}")])  # fmt: skip
        return outcome

    return play


def _metadata() -> list[bytes]:
    with TemporaryDirectory() as folder:
        write_record(_record(), Path(folder) / "bag")
        return [(Path(folder) / "bag" / "metadata.yaml").read_bytes()]


def _play_metadata(folder: Path, data: bytes, number: int) -> Outcome:
    bag = folder / f"bag{number}"
    bag.mkdir(exist_ok=True)
    (bag / "metadata.yaml").write_bytes(data)
    (bag / "bag.mcap").write_bytes(_bag(".mcap"))
    (bag / f"bag{number}.mcap").write_bytes(_bag(".mcap"))
    return try_readers(lambda: read_record([bag]), lambda: read_record([bag], strict=False))


def _rigs() -> list[bytes]:
    files = sorted(f for folder in rig_folders() for f in folder.glob("*.yaml"))
    return [f.read_bytes() for f in files]


EXPORTED = ("mjcf", "urdf", "sdf", "isaac", "bam")


def _play_rig(folder: Path, data: bytes, number: int) -> Outcome:
    rig = folder / "rig.yaml"
    rig.write_bytes(data)
    outcome = try_readers(lambda: load_rig(rig))
    if outcome.kind != RESULT and number % EVERY:
        return outcome
    bag = folder / f"rig{number}.mcap"
    exported = str(folder / f"rig{number}.out")
    verbs = (
        ["simulate", str(rig), "--out", str(bag), "--duration", "1", "--excitation", "white_noise"],
        ["export", f"--{EXPORTED[number // 3 % len(EXPORTED)]}", str(rig), "--no-play", "--out", exported],
        ["simulate", str(rig), "--out", str(bag), "--duration", "1", "--no-noise", "--excitation", "steps"],
    )
    return call(verbs[number % 3])


def _units() -> list[bytes]:
    return [(rig_folders()[0].parent / "design" / "motor_gear_units.yaml").read_bytes()]


def _play_units(folder: Path, data: bytes, number: int) -> Outcome:
    file = folder / "units.yaml"
    file.write_bytes(data)
    outcome = try_readers(lambda: catalogue(file))
    if outcome.kind == RESULT and number % EVERY == 0:
        return call(["design", "--catalogue", str(file), "--out", str(folder / "design")])
    return outcome


PAGE = b"""<?xml version="1.0" encoding="utf-8"?><netft><cfgcpf>1000000</cfgcpf><cfgcpt>1000000</cfgcpt>
<scfgfu>N</scfgfu><scfgtu>Nm</scfgtu><comrdtrate>7000</comrdtrate><cfgnam>bench</cfgnam></netft>"""
BOMB = (b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">' +
        b"".join(b'<!ENTITY %c "%s">' % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(9)) +
        b"]><netft><cfgcpf>&j;</cfgcpf></netft>")  # fmt: skip


def _play_page(folder: Path, data: bytes, number: int) -> Outcome:
    return try_readers(lambda: parse(data).wrench((1, 2, 3, 4, 5, 6)))


def _noise() -> list[bytes]:
    names = ("ft", "position", "velocity", "motor_torque")
    body = {"schema": 1, "noise_rms": dict.fromkeys(names, 0.01), "residual_rms": dict.fromkeys(names, 0.02)}
    return [json.dumps(body).encode()]


def _play_noise(folder: Path, data: bytes, number: int) -> Outcome:
    file = folder / "identification.json"
    file.write_bytes(data)
    return try_readers(lambda: noise_from(load_rig(RIG), str(file)))


def _settings() -> list[bytes]:
    return [
        f"{n}:{','.join(f'{k}={v}' for k, v in e.typical.items())}".encode() for n, e in effects().items()
    ]


def _play_setting(folder: Path, data: bytes, number: int) -> Outcome:
    text = data.decode("utf-8", "surrogateescape").replace("\x00", "")
    outcome = try_readers(lambda: parse_effect(text))
    if outcome.kind != RESULT:
        return outcome
    return call(
        ["simulate", RIG, f"--effect={text}", "--duration", "0.5", "--out", str(folder / f"{number}.mcap")]
    )


def _damaged_setting(rng: random.Random, data: bytes, other: bytes) -> bytes:
    text = data.decode("utf-8", "replace")
    odd = (
        "nan",
        "inf",
        "-inf",
        "-1",
        "1e308",
        "1e-300",
        "0",
        "0x1",
        "1_0",
        "",
        "x",
        "=",
        "1,1",
        "1e999",
        "9" * 400,
    )
    kind = rng.randrange(4)
    if kind == 0 and "=" in text:
        parts = text.split("=")
        at = rng.randrange(1, len(parts))
        _, comma, rest = parts[at].partition(",")
        parts[at] = rng.choice(odd) + comma + rest
        return "=".join(parts).encode()
    if kind == 1:
        return (text + "," + text.partition(":")[2]).encode()
    return damage_bytes(rng, data, other)


FORMATS = (
    Format("mcap", lambda: [_bag(".mcap")], damaged_mcap, _play_bag(".mcap")),
    Format(
        "sqlite",
        lambda: [*[_bag(".db3")] * 30, bag_of_views(_bag(".db3"))],
        damaged_sqlite,
        _play_bag(".db3"),
    ),
    Format("metadata", _metadata, damaged_yaml, _play_metadata),
    Format("rig", _rigs, damaged_yaml, _play_rig),
    Format(
        "map",
        lambda: [MAP.encode(), RATED.encode(), EXPRESSED.encode()],
        damaged_yaml,
        play_import("run.csv", True),
    ),
    Format("structs.mat", struct_files, damage_bytes, play_import("run.mat", False, STRUCTS)),
    Format("npz", npz_files, damaged_npz, play_import("run.npz", False, LISTED)),
    Format("parquet", parquet_files, damaged_parquet, play_import("run.parquet", False, LISTED)),
    Format("json.table", json_tables, damaged_json, play_import("run.json", False, LISTED)),
    Format("csv", lambda: [CSV.encode()], damaged_table, play_import("run.csv", False)),
    Format("tsv", lambda: [CSV.replace(",", "\t").encode()], damaged_table, play_import("run.tsv", False)),
    Format("csv.gz", lambda: [gzip.compress(CSV.encode())], damaged_gzip, play_import("run.csv.gz", False)),
    Format("mat", mat_files, damage_bytes, play_import("run.mat", False)),
    Format("catalogue", _units, damaged_yaml, _play_units),
    Format("calibration", lambda: [PAGE, BOMB], damage_bytes, _play_page),
    Format("json", _noise, damaged_json, _play_noise),
    Format("effect", _settings, _damaged_setting, _play_setting),
)
SHARES = {"mcap": 5, "sqlite": 3, "metadata": 2, "rig": 5, "map": 3, "csv": 3, "mat": 3}
"""Parts of all files; one part for a format that is not named here."""
