"""The same measurement in every format that is read, and the files that each refuses."""

import json
import pickle
import subprocess
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from msg_adapters.tables import column_files, json_file
from msg_adapters.tables.column_files import read_columns
from rsea_ros.errors import ImportMapError

T = np.arange(6) * 0.01
Q = np.arange(18.0).reshape(6, 3)  # a sample a row, a joint a column


@pytest.fixture
def write(tmp_path):
    """Return a function that writes T and Q in a format and returns the file."""

    def to(suffix):
        file = tmp_path / f"run{suffix}"
        if suffix == ".mat":
            savemat(file, {"t": T, "log": {"q": Q, "t": T}, "q": Q, "side": Q.T})
        elif suffix == ".npz":
            np.savez_compressed(file, t=T, q=Q, side=Q.T)
        elif suffix == ".parquet":
            table = {"t": T, "q": pa.FixedSizeListArray.from_arrays(pa.array(Q.ravel()), 3)}
            pq.write_table(pa.table(table), file, row_group_size=4)
        elif suffix == ".json":
            file.write_text(json.dumps({"t": T.tolist(), "q": Q.tolist(), "side": Q.T.tolist()}))
        elif suffix == ".jsonl":
            samples = zip(T, Q.tolist(), strict=True)
            file.write_text("\n".join(json.dumps({"t": t, "q": q}) for t, q in samples))
        else:
            np.savetxt(file, np.column_stack([T, Q]), delimiter=",")
        return file

    return to


@pytest.mark.parametrize(
    ("suffix", "columns"),
    [
        (".csv", ("1", "4")),
        (".mat", ("t", "q(:,3)")),
        (".mat", ("t", "side(3, :)")),
        (".mat", ("log.t", "log.q[2]")),
        (".npz", ("t", "q[:,2]")),
        (".npz", ("t", "side[2,:]")),
        (".parquet", ("t", "q[2]")),
        (".json", ("t", "q[2]")),
        (".json", ("t", "side[2,:]")),
        (".jsonl", ("t", "q[2]")),
    ],
)
def test_every_format_gives_the_same_numbers(write, suffix, columns):
    table = read_columns(write(suffix), columns)
    assert np.allclose(table[columns[0]], T)
    assert table[columns[1]].tolist() == Q[:, 2].tolist()


def assert_refused(file, column, text):
    with pytest.raises(ImportMapError, match=text) as error:
        read_columns(file, ["t", column] if file.suffix not in (".csv", ".npy") else [column])
    assert str(file) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("suffix", "column", "text"),
    [
        (".csv", "5", "no column '5', expected one of 1, 2, 3, 4"),
        (".mat", "q", r"variable 'q' is double \(6, 3\), .* a column of the matrix, q\(:,1\) to q\(:,3\)"),
        (".mat", "log", r"variable 'log' is struct \(1, 1\), expected a vector"),
        (".npz", "q", r"array 'q' is float64 \(6, 3\), expected a vector .* q\[0\]"),
        (".npz", "q[3]", r"array 'q' is float64 \(6, 3\), no 'q\[3\]'"),
        (".parquet", "q", r"column 'q' is fixed_size_list.*expected one number of it: q\[0\]"),
        (".parquet", "q[3]", r"column 'q\[3\]' has a list of 3 numbers, expected more than 3"),
        (".parquet", "t[0]", r"column 't\[0\]' is double, expected lists"),
        (".json", "q", r"sample 1, column 'q' is \[0.0, 1.0, 2.0\], expected a finite number: q\[0\]"),
        (".json", "q[3]", r"sample 1, column 'q\[3\]' is .* expected a list of more than 3"),
    ],
)
def test_an_unknown_column_is_named(write, suffix, column, text):
    assert_refused(write(suffix), column, text)


def test_records_nested_below_other_keys_are_read(tmp_path):
    file = tmp_path / "run.json"
    samples = [{"t": 0.0, "motor": {"i": 1}}, {"t": 0.1, "motor": {"i": None}}, {"t": 0.2}]
    file.write_text(json.dumps({"robot": "arm", "log": {"samples": samples}}))
    table = read_columns(file, ["log.samples.t", "log.samples.motor.i"])
    assert table["log.samples.t"].tolist() == [0.0, 0.1, 0.2]
    assert np.isnan(table["log.samples.motor.i"]).tolist() == [False, True, True]
    with pytest.raises(ImportMapError, match=r"expected one of robot, log.samples.t, log.samples.motor.i"):
        read_columns(file, ["t"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"t": [0, 1], "t": [2, 3]}', "key 't' stands twice"),
        ('{"t": [0, 1e999]}', "sample 2, column 't' is inf, expected a finite number"),
        ('{"t": [0, "1"]}', "sample 2, column 't' is '1', expected a finite number"),
        ('{"t": [0, ' + "9" * 5000 + "]}", "digits"),
        ('{"t": [0, 1]', "line 1, column 13: expecting ',' delimiter, expected JSON"),
        ("[" * 100_000, "too many levels"),
        ("", "line 1, column 1: expecting value, expected JSON"),
    ],
)
def test_json_without_a_table_is_refused(tmp_path, text, message):
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(ImportMapError, match=message):
        read_columns(tmp_path / "run.json", ["t"])


def test_no_pickle_is_opened(tmp_path):
    np.savez(tmp_path / "run.npz", t=T, q=np.array([{}, print], dtype=object))
    assert_refused(tmp_path / "run.npz", "q", "array 'q' holds Python objects, expected numbers")


def test_the_size_of_an_array_is_checked_before_it_is_read(tmp_path, monkeypatch):
    np.savez(tmp_path / "run.npz", t=T, q=Q)
    monkeypatch.setattr(column_files, "LARGEST", 10)
    assert_refused(
        tmp_path / "run.npz", "q[0]", r"array 'q' is float64 \(6, 3\), expected fewer than 10 numbers"
    )


def test_an_array_that_promises_more_than_the_file_holds_is_refused(tmp_path):
    np.savez(tmp_path / "run.npz", t=T)
    data = (tmp_path / "run.npz").read_bytes()
    with zipfile.ZipFile(tmp_path / "run.npz", "w") as archive:
        start = data.index(b"\x93NUMPY")
        held = data[start : start + 128 + T.nbytes].replace(b"(6,), }  ", b"(600,), }")
        archive.writestr("t.npy", held)
    with pytest.raises(ImportMapError, match=r"array 't' is float64 \(600,\), more than its 176 bytes"):
        read_columns(tmp_path / "run.npz", ["t"])


@pytest.mark.parametrize("header", [b"{'descr': '<f8', 'shape': (6,), ", b"{'descr': ((((((", b"\x00\xff('"])
def test_a_damaged_header_is_one_line(tmp_path, header):
    """Damaged files in `bench inputs` brought an error of the tokenizer that nobody had thought of."""
    with zipfile.ZipFile(tmp_path / "run.npz", "w") as archive:
        text = header.ljust(117) + b"\n"
        archive.writestr("t.npy", b"\x93NUMPY\x01\x00v\x00" + text + T.tobytes())
    with pytest.raises(ImportMapError, match=r"run.npz: array 't' has no header that can be read"):
        read_columns(tmp_path / "run.npz", ["t"])


def test_npy_is_read_as_one_matrix_and_as_fields(tmp_path):
    np.save(tmp_path / "run.npy", Q)
    assert read_columns(tmp_path / "run.npy", ["2"])["2"].tolist() == Q[:, 1].tolist()
    assert_refused(tmp_path / "run.npy", "4", "no column '4', expected one of 1, 2, 3")
    np.save(tmp_path / "fields.npy", np.array([(0.0, 1), (0.1, 2)], [("t", "f8"), ("n", "i4")]))
    assert read_columns(tmp_path / "fields.npy", ["n"])["n"].tolist() == [1.0, 2.0]


def test_stamps_holes_and_fields_of_parquet_are_read(tmp_path):
    stamps = pa.array([0, 5_000_000, None], pa.timestamp("ns"))
    pose = pa.array([{"x": 1.0}, {"x": None}, None], pa.struct([("x", pa.float32())]))
    pq.write_table(pa.table({"t": stamps, "pose": pose, "word": ["a", "b", "c"]}), tmp_path / "run.parquet")
    table = read_columns(tmp_path / "run.parquet", ["t", "pose.x"])
    assert table["t"][:2].tolist() == [0.0, 0.005]
    assert [np.isnan(column).sum() for column in table.columns.values()] == [1, 2]
    assert_refused(tmp_path / "run.parquet", "word", "column 'word' is string, expected numbers")
    assert_refused(tmp_path / "run.parquet", "pose.y", "pose is struct.*, expected a struct with y")


@pytest.mark.parametrize("suffix", [".npz", ".npy", ".parquet", ".json"])
@pytest.mark.parametrize("content", [b"", b"PAR1 and no", b"PK\x03\x04 cut", b"\x93NUMPY\x01\x00\xff\xff{"])
def test_files_of_another_format_are_refused(tmp_path, suffix, content):
    (tmp_path / f"run{suffix}").write_bytes(content)
    with pytest.raises(ImportMapError, match=r"run\."):
        read_columns(tmp_path / f"run{suffix}", ["t"])


def test_structs_in_an_array_are_numbered(tmp_path):
    runs = np.zeros((2,), dtype=[("t", object)])
    runs["t"] = [T, T + 1.0]
    savemat(tmp_path / "run.mat", {"runs": runs})
    assert read_columns(tmp_path / "run.mat", ["runs(2).t"])["runs(2).t"].tolist() == (T + 1.0).tolist()
    with pytest.raises(ImportMapError, match=r"runs is an array of 2 structs, expected which: runs\(1\)"):
        read_columns(tmp_path / "run.mat", ["runs.t"])


@pytest.mark.parametrize("header", [None, False])
def test_a_first_line_with_a_hole_is_data_where_the_map_says_so(tmp_path, header):
    """Without `header` a first line with `nan` in it passes for names."""
    (tmp_path / "run.csv").write_text("0.0,nan\n0.1,5\n0.2,6\n")
    table = read_columns(tmp_path / "run.csv", ["1", "2"], header=header)
    assert len(table["2"]) == (2 if header is None else 3)


@pytest.mark.parametrize(
    ("name", "head", "words"),
    [
        ("log.h5", b"\x89HDF\r\n\x1a\n", r"is an HDF5 file, expected a table: .*numpy\.savez"),
        ("log.xlsx", b"PK\x03\x04", "is a spreadsheet .* save the sheet as CSV"),
        ("log.dat", b"PAR1", r"is a Parquet file, .* call it \.parquet"),
        ("run.mcap", b"\x89MCAP0\r\n", "is a bag, .* needs no import"),
        ("log.pkl", pickle.dumps(np.arange(3), 4), "is a pickle, which may run any program"),
    ],
)
def test_a_foreign_file_is_named_with_its_remedy(tmp_path, name, head, words):
    """They were "not a text", or columns with names of noise."""
    (tmp_path / name).write_bytes(head + bytes(range(256)) * 3)
    with pytest.raises(ImportMapError, match=f"{name}: {words}"):
        read_columns(tmp_path / name, ["t"])


@pytest.mark.parametrize("header", [".zgroup", ".zarray", "zarr.json"])
def test_a_zarr_group_is_refused_with_the_line_that_converts_it(tmp_path, header):
    (tmp_path / header).write_text("{}")
    with pytest.raises(ImportMapError, match=r"is a zarr group, .* NPZ by python -c 'import .*\(\)\)\)'$"):
        read_columns(tmp_path, ["t"])


def test_json_beyond_a_size_is_refused(tmp_path, monkeypatch):
    (tmp_path / "run.json").write_text(json.dumps({"t": T.tolist()}))
    monkeypatch.setattr(json_file, "LARGEST_FILE", 20)
    with pytest.raises(ImportMapError, match="bytes of JSON, expected fewer than 20"):
        read_columns(tmp_path / "run.json", ["t"])


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
    monkeypatch.setattr(column_files, "PROGRAM", tmp_path / "child.py")
    monkeypatch.setattr(column_files, "SECONDS", 0.3 if "while" in program else 20.0)
    with pytest.raises(ImportMapError, match=message):
        read_columns(tmp_path / "run.mat", ["x"])


def test_a_file_that_declares_more_than_memory_is_refused(tmp_path, monkeypatch):
    """A vector of a hundred million numbers that the file does not hold, declared in its header."""
    monkeypatch.setattr(column_files, "subprocess", subprocess)  # which has limits
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
