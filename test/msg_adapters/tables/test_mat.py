"""MAT files."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import savemat

from msg_adapters.tables.files import read_columns
from rsea_ros.errors import ImportMapError


def test_vectors_of_any_orientation_and_type(tmp_path):
    file = tmp_path / "run.mat"
    savemat(file, {"t": np.arange(5)[:, None] * 0.1, "x": np.arange(5, dtype=np.int16)[None, :], "gain": 3.0})
    table = read_columns(file, ["x", "t"])
    assert table["x"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert np.allclose(table["t"], np.arange(5) * 0.1)


@pytest.mark.parametrize(
    ("column", "text"),
    [
        ("y", "no column 'y', expected one of t, short, word, table, gain, broken"),
        ("short", "vectors of unequal length"),
        ("word", r"variable 'word' is <U5 \(1,\), expected a vector of numbers"),
        ("table", r"variable 'table' is float64 \(2, 3\), expected a vector"),
        ("gain", r"variable 'gain' is .* \(1, 1\), expected a vector"),
        ("broken", r"broken\[3\] is nan, expected a finite number"),
    ],
)
def test_variables_that_are_no_channel(tmp_path, column, text):
    file = tmp_path / "run.mat"
    broken = np.array([0.0, 1.0, 2.0, np.nan, 4.0])
    content = {"t": np.arange(5.0), "short": np.arange(4.0), "word": "hello", "table": np.eye(2, 3)}
    savemat(file, {**content, "gain": 3.0, "broken": broken})
    with pytest.raises(ImportMapError, match=text):
        read_columns(file, ["t", column])


@pytest.mark.parametrize(
    "content", [b"", b"no MAT file at all, but a text that goes on for more than its header" * 4]
)
def test_files_that_are_no_mat(tmp_path, content):
    file = tmp_path / "run.mat"
    file.write_bytes(content)
    with pytest.raises(ImportMapError, match=str(file)):
        read_columns(file, ["t"])


@pytest.mark.parametrize("content", [b"no gzip", b"\x1f\x8b\x08\x00\x00\x00\x00\x00\x00\x03cut"])
def test_files_that_are_no_gzip(tmp_path, content):
    file = tmp_path / "run.csv.gz"
    file.write_bytes(content)
    with pytest.raises(ImportMapError, match=str(file)):
        read_columns(file, ["t"])
