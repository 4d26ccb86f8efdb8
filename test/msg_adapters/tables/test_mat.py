"""MAT files."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from scipy.io import savemat

from msg_adapters.tables import child, column_files
from msg_adapters.tables.column_files import read_columns
from rsea_ros.errors import ImportMapError


def test_vectors_of_any_orientation_and_type_are_read(tmp_path):
    file = tmp_path / "run.mat"
    savemat(file, {"t": np.arange(5)[:, None] * 0.1, "x": np.arange(5, dtype=np.int16)[None, :], "gain": 3.0})
    table = read_columns(file, ["x", "t"])
    assert table["x"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert np.allclose(table["t"], np.arange(5) * 0.1)


@pytest.mark.parametrize(
    ("column", "text"),
    [
        ("y", "no column 'y', expected one of t, short, word, table, gain, broken, angle, cell"),
        ("short", "vectors of unequal length"),
        ("word", r"variable 'word' is char \(1,\), expected a vector of numbers"),
        ("gain", r"variable 'gain' is .* \(1, 1\), expected a vector"),
        ("broken", r"broken\[3\] is inf, expected a finite number"),
        ("angle", r"variable 'angle' is complex128 .*, expected a vector of numbers"),
    ],
)
def test_variables_that_cannot_be_a_channel_are_refused(tmp_path, column, text):
    file = tmp_path / "run.mat"
    broken = np.array([0.0, 1.0, 2.0, np.inf, 4.0])
    content = {"t": np.arange(5.0), "short": np.arange(4.0), "word": "hello", "table": np.eye(2, 3)}
    content |= {"gain": 3.0, "broken": broken, "angle": np.arange(5) * 1j, "cell": {"a": 1.0}}
    savemat(file, content)
    with pytest.raises(ImportMapError, match=text):
        read_columns(file, ["t", column])


def test_only_what_is_named_is_loaded_and_its_size_comes_first(tmp_path, monkeypatch):
    file = tmp_path / "run.mat"
    savemat(file, {"x": np.arange(50.0), "large": np.zeros(400)})
    monkeypatch.setattr(column_files, "LARGEST", 100)
    assert read_columns(file, ["x"])["x"].size == 50
    with pytest.raises(ImportMapError, match="variable 'large' has 400 values, expected fewer than 100"):
        read_columns(file, ["large"])


@pytest.mark.parametrize("head", [b"MATLAB 7.3 MAT-file, Platform: GLNXA64", b"\x89HDF\r\n\x1a\n"])
def test_version_7_3_is_named(tmp_path, head):
    (tmp_path / "run.mat").write_bytes(head + bytes(600))
    with pytest.raises(
        ImportMapError, match=r"run.mat: MAT file of version 7.3 .* save\(…, '-v7'\) in MATLAB"
    ):
        read_columns(tmp_path / "run.mat", ["t"])


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("import os; os.kill(os.getpid(), 11)", "could not be read: the MAT reader ended with SIGSEGV"),
        ("raise SystemExit(3)", "could not be read: the MAT reader ended with status 3"),
        ("print('hello')", "could not be read: the MAT reader gave no answer"),
        ("while True: pass", "could not be read within 0.3 s"),
    ],
)
def test_a_reader_that_fails_is_one_line(tmp_path, monkeypatch, program, message):
    (tmp_path / "child.py").write_text(program)
    savemat(tmp_path / "run.mat", {"x": np.arange(5.0)})
    monkeypatch.setattr(child, "PROGRAM", tmp_path / "child.py")
    monkeypatch.setattr(child, "SECONDS", 0.3 if "while" in program else 20.0)
    with pytest.raises(ImportMapError, match=message):
        read_columns(tmp_path / "run.mat", ["x"])


def test_a_file_that_declares_more_than_memory_is_refused(tmp_path, monkeypatch):
    """A vector of a hundred million numbers that the file does not hold, declared in its header."""
    monkeypatch.setattr(child, "subprocess", subprocess)  # which has limits
    savemat(tmp_path / "run.mat", {"x": np.arange(5.0)})
    data = (tmp_path / "run.mat").read_bytes()
    shape = np.array([1, 5], "<i4").tobytes()
    assert data.count(shape) == 1
    (tmp_path / "run.mat").write_bytes(data.replace(shape, np.array([1, 99_999_999], "<i4").tobytes()))
    with pytest.raises(ImportMapError, match=str(tmp_path)):
        read_columns(tmp_path / "run.mat", ["x"])


@pytest.mark.parametrize("compressed", [False, True])
def test_a_file_that_breaks_off_is_cut_off(tmp_path, compressed):
    """It said that it had no column 'w', whose values the copy had lost."""
    whole = tmp_path / "run.mat"
    rng = np.random.default_rng(0)
    savemat(whole, {"t": rng.normal(size=500), "w": rng.normal(size=500)}, do_compression=compressed)
    assert len(read_columns(whole, ["t", "w"])["w"]) == 500
    cut = tmp_path / "cut.mat"
    cut.write_bytes(whole.read_bytes()[:-1000])
    with pytest.raises(ImportMapError, match="cut off"):
        read_columns(cut, ["t", "w"])


def test_a_missing_number_is_a_hole(tmp_path):
    savemat(tmp_path / "run.mat", {"x": np.array([0.0, np.nan, 2.0])})
    assert np.isnan(read_columns(tmp_path / "run.mat", ["x"])["x"]).tolist() == [False, True, False]
