"""Tables that are imported: well-formed files of each format with their maps, and a reader."""

import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

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


STRUCTS = """time: {column: log.t, unit: s}
channels: {position: {column: "log.q(:,2)", unit: deg}, command: {column: log.i, unit: mA, scale: 3}}
"""
MAPS = (MAP, RATED, EXPRESSED)


def play_import(file_name: str, of_file: str = MAP, *, is_map: bool = False) -> Play:
    """Return the reader of a table with a map. is_map: the damaged file is the map."""

    def play(folder: Path, data: bytes, number: int) -> Outcome:
        table, maps = folder / file_name, folder / "map.yaml"
        table.write_bytes(CSV.encode() if is_map else data)
        maps.write_bytes(data if is_map else of_file.encode())
        return call(["import", str(table), "--map", str(maps), "--out", str(folder / f"bag{number}.mcap")])

    return play


def tables_as(kind: str) -> list[bytes]:
    """Return the table as files of a kind, in its variants; all but `mat` have q, a matrix of two columns."""
    rows = np.array([[float(c) for c in line.split(",")] for line in CSV.splitlines()[1:]])
    plain = dict(zip(("t", "phi", "i", "load"), rows.T, strict=True))
    columns = plain | {"q": rows[:, 1:3]}
    texts = {name: y.tolist() for name, y in columns.items()}
    if kind == "json":
        records = [dict(zip(texts, row, strict=True)) for row in zip(*texts.values(), strict=True)]
        return [json.dumps(texts).encode(), json.dumps(records).encode()]
    table = pa.table({name: pa.array(list(y)) for name, y in columns.items()})
    whole = {"log": {**columns, "notes": "a bench"}, "spare": np.zeros(3)}
    writers: Mapping[str, Sequence[Callable[[io.BytesIO], object]]] = {
        "npz": [lambda f: np.savez(f, **columns), lambda f: np.savez_compressed(f, **columns)],
        "mat": [
            lambda f: savemat(f, plain), lambda f: savemat(f, plain, do_compression=True),
            lambda f: savemat(f, plain, format="4"),
        ],
        "struct": [lambda f: savemat(f, whole)],
        "parquet": [
            lambda f, codec=codec: pq.write_table(table, f, row_group_size=20, compression=codec)
            for codec in ("snappy", "none")
        ],
    }  # fmt: skip
    files = []
    for write in writers[kind]:
        buffer = io.BytesIO()
        write(buffer)
        files.append(buffer.getvalue())
    return files
