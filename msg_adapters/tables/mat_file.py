"""Vectors out of MAT files, read in another process (see `_mat_child.py`)."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from msg_adapters.tables.table import LARGEST, Table, index_of
from rsea_ros.wording import shown

CHILD = Path(__file__).with_name("_mat_child.py")
TIME = 90.0
"""s. The largest file that is read takes 3 s."""
_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_mat(path: Path, columns: Sequence[str]) -> Table:
    """Return the variables asked for. Raises OSError and ValueError with variable, shape and expectation."""
    _refuse_version_7_3(path)
    with tempfile.TemporaryFile() as output:
        _run([str(path.absolute()), str(LARGEST), *columns], output)
        output.seek(0)
        answer = _answer(output.readline())
        if "names" in answer:
            index_of(answer["column"], answer["names"])
        if "sizes" not in answer:
            raise ValueError(shown(str(answer.get("error")), 200)[1:-1])
        sizes = dict(zip(columns, answer["sizes"], strict=True))
        if len(set(sizes.values())) > 1:
            raise ValueError(f"vectors of unequal length {sizes}, expected one sample each at every stamp")
        vectors = {name: np.frombuffer(output.read(8 * size), "<f8") for name, size in sizes.items()}
    for name, vector in vectors.items():
        if np.isinf(vector).any():
            at = int(np.flatnonzero(np.isinf(vector))[0])
            raise ValueError(f"{name}[{at}] is {vector[at]}, expected a finite number")
    return Table(vectors, next(iter(sizes.values())))


def _refuse_version_7_3(path: Path) -> None:
    with path.open("rb") as file:
        head = file.read(520)
    if head.startswith(b"MATLAB 7.3") or _HDF5 in (head[:8], head[512:]):
        raise ValueError("MAT file of version 7.3 (HDF5), expected version 7: save(…, '-v7') in MATLAB")


def _run(arguments: list[str], output: IO[bytes]) -> None:
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-I", str(CHILD), *arguments]
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.DEVNULL,
            env=environment, timeout=TIME, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ValueError(f"could not be read within {TIME:g} s") from None
    if done.returncode:
        code = done.returncode
        reason = signal.Signals(-code).name if code < 0 else f"status {code}"
        raise ValueError(f"could not be read: the MAT reader ended with {reason}; a damaged file?")


def _answer(line: bytes) -> dict[str, Any]:
    try:
        answer = json.loads(line)
    except ValueError:
        answer = None
    if not isinstance(answer, dict):
        raise ValueError("could not be read: the MAT reader gave no answer; a damaged file?")
    return answer
