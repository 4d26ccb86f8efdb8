"""Import of ten million rows: memory and time of CSV and Parquet, each in a child of its own.

    python bench/import_size.py [--rows 10000000]

Status 1 where one takes more than CEILING of memory. Files and bags lie in the temporary folder meanwhile.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

ROOT = Path(__file__).resolve().parents[1]
CEILING = 1.5e9
"""Bytes resident, of the import and of its reader together."""
MAP = """time: {column: t, unit: s}
channels: {command: {column: u, unit: N m}, position: {column: x, unit: deg}}
"""
BLOCK = 500_000


def main(arguments: Sequence[str] | None = None) -> int:
    """Make both files, import each, print a line for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=10_000_000, help="of each file (default %(default)s)")
    rows = parser.parse_args(arguments).rows
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "map.yaml").write_text(MAP)
        _write(folder, rows)
        largest = max(_import(folder, suffix) for suffix in ("parquet", "csv"))
    return int(largest > CEILING)


def _write(folder: Path, rows: int) -> None:
    """Write the same columns as CSV and as Parquet, block by block."""
    rng = np.random.default_rng(0)
    schema = pa.schema([("t", pa.float64()), ("u", pa.float64()), ("x", pa.float64())])
    with (folder / "run.csv").open("w") as text, pq.ParquetWriter(folder / "run.parquet", schema) as writer:
        text.write("t,u,x\n")
        for start in range(0, rows, BLOCK):
            t = np.arange(start, min(start + BLOCK, rows)) * 1e-3
            u, x = rng.standard_normal((2, len(t)))
            writer.write_table(pa.table([t, u, x], schema=schema))
            text.writelines(f"{a:.3f},{b:.5f},{c:.6f}\n" for a, b, c in zip(t, u, x, strict=True))


def _import(folder: Path, suffix: str) -> float:
    """Import a file in a child; print and return its memory, bytes."""
    arguments = ["import", f"run.{suffix}", "--map", "map.yaml", "--out", suffix]
    program = f"import sys; from rsea_ros.cli.main import main; sys.exit(main({arguments!r}))"
    watch = f"""
import resource, sys
sys.path.insert(0, {str(ROOT)!r})
try:
    exec({program!r})
finally:
    used = [resource.getrusage(w).ru_maxrss for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print("memory", sum(used))
"""
    began = time.monotonic()
    command = [sys.executable, "-c", watch]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    memory = 1024.0 * float(done.stdout.split()[-1])
    size = (folder / f"run.{suffix}").stat().st_size
    print(f"{suffix:8} {size / 1e6:6.0f} MB: status {done.returncode}, {memory / 1e6:.0f} MB of memory,"
          f" {time.monotonic() - began:.0f} s{done.stderr}", flush=True)  # fmt: skip
    return memory


if __name__ == "__main__":
    sys.exit(main())
