"""Every format that is read: well-formed files to begin with, how they are damaged, and who reads them."""

from __future__ import annotations

import gzip
import io
import json
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from inputs_arrays import damaged_npz, damaged_parquet
from inputs_bag_files import bag_of_views, damaged_mcap, damaged_sqlite
from inputs_bytes import damaged
from inputs_documents import damaged_json, damaged_table, damaged_yaml
from inputs_outcome import REFUSED, RESULT, Outcome, call

from msg_adapters import iterate, read_record, write_record
from rsea_ros.cli.simulate import parse_effect
from rsea_ros.design.catalogue import catalogue
from rsea_ros.effects.catalogue import catalogue as effects
from rsea_ros.errors import RseaError
from rsea_ros.hardware.netft.calibration import parse
from rsea_ros.model.rig_file import load_rig, rig_folders
from rsea_ros.nodes._model_noise import noise_from
from rsea_ros.signals import Channel, Record

RIG = "paper_high_impedance"
EVERY = 8
"""Of what is read without complaint, one in so many goes on into a verb that computes with it."""
Damage = Callable[[random.Random, bytes, bytes], bytes]
Play = Callable[[Path, bytes, int], Outcome]


@dataclass(frozen=True)
class Format:
    """name; seeds: well-formed files; damage: makes another of one; play: reads it, in a folder."""

    name: str
    seeds: Callable[[], Sequence[bytes]]
    damage: Damage
    play: Play


def tried(*readers: Callable[[], object]) -> Outcome:
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
        outcome = tried(lambda: read_record([bag]), lambda: read_record([bag], strict=False),
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
    return tried(lambda: read_record([bag]), lambda: read_record([bag], strict=False))


def _rigs() -> list[bytes]:
    files = sorted(f for folder in rig_folders() for f in folder.glob("*.yaml"))
    return [f.read_bytes() for f in files]


EXPORTED = ("mjcf", "urdf", "sdf", "isaac", "bam")


def _play_rig(folder: Path, data: bytes, number: int) -> Outcome:
    rig = folder / "rig.yaml"
    rig.write_bytes(data)
    outcome = tried(lambda: load_rig(rig))
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


CSV = "t,phi,i,load\n" + "".join(f"{k / 100:.2f},{k % 7},{k % 11 - 5},{k}\n" for k in range(60))
MAP = """about: a bench
time: {column: t, unit: s}
where: {column: load, below: 50}
channels:
  position: {column: phi, unit: deg, sign: -1}
  command: [{column: i, unit: mA, scale: 6.8}, {column: load, unit: N m, constant: 0.5}]
"""


RATED = """delimiter: ","
time: {rate: 100}
where: {column: load, from: 3}
channels: {velocity: {column: phi, unit: rpm}, position: [{column: i, unit: mrad, scale: 1, constant: 0}]}
"""


EXPRESSED = """header: true
time: {expression: "t + 0 * i", unit: s}
runs: {column: load}
channels:
  position: {expression: "derivative(clip(phi, -3, 3)) * column('i') ** 2", unit: deg}
"""
LISTED = """time: {column: t, unit: s}
channels:
  position: {column: "q[1]", unit: deg}
  command: {expression: "i * column('q[0]')", unit: mA, scale: 3}
"""


def _play_import(file_name: str, is_map: bool, of_file: str = MAP) -> Play:
    def play(folder: Path, data: bytes, number: int) -> Outcome:
        table, maps = folder / file_name, folder / "map.yaml"
        table.write_bytes(_CSV_AS[file_name] if is_map else data)
        maps.write_bytes(data if is_map else of_file.encode())
        return call(["import", str(table), "--map", str(maps), "--out", str(folder / f"bag{number}.mcap")])

    return play


def _mat() -> list[bytes]:
    from scipy.io import savemat

    rows = np.array([[float(c) for c in line.split(",")] for line in CSV.splitlines()[1:]])
    columns = dict(zip(("t", "phi", "i", "load"), rows.T, strict=True))
    kinds = ({"do_compression": False}, {"do_compression": True}, {"format": "4"})
    files = []
    for options in kinds:
        buffer = io.BytesIO()
        savemat(buffer, columns, **options)
        files.append(buffer.getvalue())
    return files


def _columns() -> dict[str, np.ndarray]:
    """Return t, i and load, and q with a matrix of two columns."""
    rows = np.array([[float(c) for c in line.split(",")] for line in CSV.splitlines()[1:]])
    return dict(zip(("t", "phi", "i", "load"), rows.T, strict=True)) | {"q": rows[:, 1:3]}


def _npz() -> list[bytes]:
    files = []
    for save in (np.savez, np.savez_compressed):
        buffer = io.BytesIO()
        save(buffer, **_columns())
        files.append(buffer.getvalue())
    return files


def _parquet() -> list[bytes]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = []
    for codec in ("snappy", "none"):
        buffer = io.BytesIO()
        columns = {name: pa.array(list(y)) for name, y in _columns().items()}
        pq.write_table(pa.table(columns), buffer, row_group_size=20, compression=codec)
        files.append(buffer.getvalue())
    return files


def _json() -> list[bytes]:
    columns = {name: y.tolist() for name, y in _columns().items()}
    records = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    return [json.dumps(columns).encode(), json.dumps(records).encode()]


def _structs() -> list[bytes]:
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, {"log": {**_columns(), "notes": "a bench"}, "spare": np.zeros(3)})
    return [buffer.getvalue()]


STRUCTS = """time: {column: log.t, unit: s}
channels: {position: {column: "log.q(:,2)", unit: deg}, command: {column: log.i, unit: mA, scale: 3}}
"""
_CSV_AS = {
    "run.csv": CSV.encode(),
    "run.tsv": CSV.replace(",", "\t").encode(),
    "run.csv.gz": gzip.compress(CSV.encode()),
}


def _gzipped(rng: random.Random, data: bytes, other: bytes) -> bytes:
    try:
        plain = gzip.decompress(data)
    except Exception:
        return damaged(rng, data, other)
    if rng.random() < 0.02:
        return gzip.compress(bytes(400_000_000), compresslevel=1)
    return gzip.compress(damaged_table(rng, plain)) if rng.random() < 0.5 else damaged(rng, data, other)


def _units() -> list[bytes]:
    return [(rig_folders()[0].parent / "design" / "motor_gear_units.yaml").read_bytes()]


def _play_units(folder: Path, data: bytes, number: int) -> Outcome:
    file = folder / "units.yaml"
    file.write_bytes(data)
    outcome = tried(lambda: catalogue(file))
    if outcome.kind == RESULT and number % EVERY == 0:
        return call(["design", "--catalogue", str(file), "--out", str(folder / "design")])
    return outcome


PAGE = b"""<?xml version="1.0" encoding="utf-8"?><netft><cfgcpf>1000000</cfgcpf><cfgcpt>1000000</cfgcpt>
<scfgfu>N</scfgfu><scfgtu>Nm</scfgtu><comrdtrate>7000</comrdtrate><cfgnam>bench</cfgnam></netft>"""
BOMB = (b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">' +
        b"".join(b'<!ENTITY %c "%s">' % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(9)) +
        b"]><netft><cfgcpf>&j;</cfgcpf></netft>")  # fmt: skip


def _play_page(folder: Path, data: bytes, number: int) -> Outcome:
    return tried(lambda: parse(data).wrench((1, 2, 3, 4, 5, 6)))


def _noise() -> list[bytes]:
    names = ("ft", "position", "velocity", "motor_torque")
    body = {"schema": 1, "noise_rms": dict.fromkeys(names, 0.01), "residual_rms": dict.fromkeys(names, 0.02)}
    return [json.dumps(body).encode()]


def _play_noise(folder: Path, data: bytes, number: int) -> Outcome:
    file = folder / "identification.json"
    file.write_bytes(data)
    return tried(lambda: noise_from(load_rig(RIG), str(file)))


def _settings() -> list[bytes]:
    return [
        f"{n}:{','.join(f'{k}={v}' for k, v in e.typical.items())}".encode() for n, e in effects().items()
    ]


def _play_setting(folder: Path, data: bytes, number: int) -> Outcome:
    text = data.decode("utf-8", "surrogateescape").replace("\x00", "")
    outcome = tried(lambda: parse_effect(text))
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
    return damaged(rng, data, other)


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
        _play_import("run.csv", True),
    ),
    Format("structs.mat", _structs, damaged, _play_import("run.mat", False, STRUCTS)),
    Format("npz", _npz, damaged_npz, _play_import("run.npz", False, LISTED)),
    Format("parquet", _parquet, damaged_parquet, _play_import("run.parquet", False, LISTED)),
    Format("json.table", _json, damaged_json, _play_import("run.json", False, LISTED)),
    Format("csv", lambda: [CSV.encode()], damaged_table, _play_import("run.csv", False)),
    Format("tsv", lambda: [CSV.replace(",", "\t").encode()], damaged_table, _play_import("run.tsv", False)),
    Format("csv.gz", lambda: [gzip.compress(CSV.encode())], _gzipped, _play_import("run.csv.gz", False)),
    Format("mat", _mat, damaged, _play_import("run.mat", False)),
    Format("catalogue", _units, damaged_yaml, _play_units),
    Format("calibration", lambda: [PAGE, BOMB], damaged, _play_page),
    Format("json", _noise, damaged_json, _play_noise),
    Format("effect", _settings, _damaged_setting, _play_setting),
)
SHARES = {"mcap": 5, "sqlite": 3, "metadata": 2, "rig": 5, "map": 3, "csv": 3, "mat": 3}
"""Parts of all files; one part for a format that is not named here."""
