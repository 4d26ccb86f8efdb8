"""Tables that are imported: well-formed files of each format with their maps, and a reader."""

from __future__ import annotations

import gzip
import io
import json
import random
from pathlib import Path

import numpy as np

from bench.inputs.bytes_damage import damage_bytes
from bench.inputs.documents import damaged_table
from bench.inputs.outcome import Outcome, Play, call

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


def play_import(file_name: str, is_map: bool, of_file: str = MAP) -> Play:
    def play(folder: Path, data: bytes, number: int) -> Outcome:
        table, maps = folder / file_name, folder / "map.yaml"
        table.write_bytes(_CSV_AS[file_name] if is_map else data)
        maps.write_bytes(data if is_map else of_file.encode())
        return call(["import", str(table), "--map", str(maps), "--out", str(folder / f"bag{number}.mcap")])

    return play


def mat_files() -> list[bytes]:
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


def npz_files() -> list[bytes]:
    files = []
    for save in (np.savez, np.savez_compressed):
        buffer = io.BytesIO()
        save(buffer, **_columns())
        files.append(buffer.getvalue())
    return files


def parquet_files() -> list[bytes]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = []
    for codec in ("snappy", "none"):
        buffer = io.BytesIO()
        columns = {name: pa.array(list(y)) for name, y in _columns().items()}
        pq.write_table(pa.table(columns), buffer, row_group_size=20, compression=codec)
        files.append(buffer.getvalue())
    return files


def json_tables() -> list[bytes]:
    columns = {name: y.tolist() for name, y in _columns().items()}
    records = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    return [json.dumps(columns).encode(), json.dumps(records).encode()]


def struct_files() -> list[bytes]:
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


def damaged_gzip(rng: random.Random, data: bytes, other: bytes) -> bytes:
    try:
        plain = gzip.decompress(data)
    except Exception:
        return damage_bytes(rng, data, other)
    if rng.random() < 0.02:
        return gzip.compress(bytes(400_000_000), compresslevel=1)
    return gzip.compress(damaged_table(rng, plain)) if rng.random() < 0.5 else damage_bytes(rng, data, other)
