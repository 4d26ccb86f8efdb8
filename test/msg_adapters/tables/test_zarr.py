"""Zarr groups, in directories and tar files: the same numbers, and one line for whatever is not read."""

from __future__ import annotations

import json
import shutil
import zlib

import numpy as np
import pytest
from zarr_groups import as_tar, blosc, header, write_group

from msg_adapters.tables.blosc import unpack_blosc
from msg_adapters.tables.column_files import read_columns
from rsea_ros.errors import ImportMapError

N = 10_000
T = 1.7e9 + np.arange(N) / 400.0
Q = np.random.default_rng(1).normal(size=(N, 3)).cumsum(axis=0)
ARRAYS = {"t": T, "q": Q, "gain": np.full(N, 85, "<f4"), "mode": np.full(N, 13, "u1")}


@pytest.fixture
def group(tmp_path):
    return write_group(tmp_path / "state", ARRAYS)


@pytest.mark.parametrize("packed", [False, True])
def test_a_group_and_its_tar_file_hold_the_same_numbers(group, packed):
    table = read_columns(as_tar(group) if packed else group, ["t", "q[2]", "gain", "mode"])
    assert np.array_equal(table["t"], T) and np.array_equal(table["q[2]"], Q[:, 2])
    assert set(table["gain"]) == {85.0} and set(table["mode"]) == {13.0}


def test_only_the_part_of_a_chunk_that_holds_samples_is_unpacked():
    """A year of samples fits into the one chunk of an array; behind the record it is zeros."""
    content = T.tobytes() + bytes(8 * N)
    chunk = bytearray(blosc(content, 8, 4096))
    chunk[-2000:] = b"\xff" * 2000
    assert unpack_blosc(bytes(chunk), len(content), T.nbytes) == T.tobytes()


@pytest.mark.parametrize("compressor", [None, {"id": "zlib", "level": 1}])
def test_other_codecs_are_read(tmp_path, compressor):
    group = write_group(tmp_path / "state", {"t": T})
    (group / "t" / ".zarray").write_text(header(T, (N,), compressor=compressor))
    (group / "t" / "0").write_bytes(zlib.compress(T.tobytes()) if compressor else T.tobytes())
    assert np.array_equal(read_columns(group, ["t"])["t"], T)


@pytest.mark.parametrize(
    ("column", "text"),
    [
        ("w", "no column 'w', expected one of gain, mode, q, t"),
        ("q", r"array 'q' has the shape \(10000, 3\), .* or one of its columns, q\[0\]"),
        ("q[3]", r"array 'q\[3\]' has the shape \(10000, 3\)"),
        ("t[0]", r"array 't\[0\]' has the shape \(10000,\), expected a vector of samples$"),
    ],
)
def test_an_unknown_array_is_named(group, column, text):
    with pytest.raises(ImportMapError, match=text):
        read_columns(group, ["t", column])


@pytest.mark.parametrize(
    ("changed", "text"),
    [
        ({"zarr_format": 3}, "no header of zarr version 2"),
        ({"dtype": "|O"}, r"of type '\|O', expected numbers"),
        ({"filters": [{"id": "delta"}]}, "filters"),
        ({"compressor": {"id": "lzma"}}, "packed by 'lzma', expected one of none, blosc, zlib"),
        ({"shape": [N, 3, 3], "chunks": [N, 3, 3]}, "expected a vector or a matrix"),
        ({"chunks": [0]}, "expected a vector or a matrix"),
        ({"chunks": [1 << 40]}, "chunks of 8796093022208 bytes, expected at most"),
        ({"shape": [1 << 40]}, "more than .* rows"),
        ({"shape": [True]}, "shape is .*, expected whole numbers"),
    ],
)
def test_a_kind_of_array_that_is_not_read_is_one_line(group, changed, text):
    (group / "t" / ".zarray").write_text(json.dumps(json.loads(header(T, (4096,))) | changed))
    with pytest.raises(ImportMapError, match=text) as error:
        read_columns(group, ["t"])
    assert str(group) in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (None, "array 't' has no file '1', expected it; a download cut off"),
        (b"", "Blosc chunk cannot be unpacked"),
        (b"\x02\x01\x21\x08" + bytes(12), "Blosc chunk of version 2 holds 0 bytes"),
        (b"\x02\x01\x01\x08\x00\x80\x00\x00\x00\x10\x00\x00\x10\x00\x00\x00", "packed by blosclz"),
        (b"\x02\x01\x25\x08\x00\x80\x00\x00\x00\x10\x00\x00\x10\x00\x00\x00", "bits shuffled"),
        (b"\x02\x01\x21\x08\x00\x80\x00\x00\x00\x10\x00\x00\x10\x00\x00\x00", "cannot be unpacked"),
    ],
)
def test_a_damaged_chunk_is_one_line(group, content, text):
    chunk = group / "t" / "1"
    chunk.unlink() if content is None else chunk.write_bytes(content)
    with pytest.raises(ImportMapError, match=text):
        read_columns(group, ["t"])


def test_every_damaged_byte_of_a_chunk_is_refused_or_read(group):
    """No mutation of a chunk may raise anything but the error of an import."""
    chunk = group / "t" / "0"
    whole, rng = chunk.read_bytes(), np.random.default_rng(3)
    for at in [*range(60), *rng.integers(60, len(whole), 100)]:
        chunk.write_bytes(whole[:at] + bytes([whole[at] ^ rng.integers(1, 256)]) + whole[at + 1 :])
        try:
            read_columns(group, ["t"])
        except ImportMapError as error:
            assert "\n" not in str(error)


def test_a_path_without_a_group_is_named(group, tmp_path):
    file = as_tar(group)
    file.write_bytes(file.read_bytes()[:3000])
    with pytest.raises(ImportMapError, match=r"state\.tar: .*(tar file|cut off)"):
        read_columns(file, ["t"])
    (tmp_path / "no.tar").write_bytes(b"no tar file")
    with pytest.raises(ImportMapError, match=r"no\.tar: no tar file that can be read"):
        read_columns(tmp_path / "no.tar", ["t"])
    (tmp_path / "root").mkdir()
    shutil.move(group, tmp_path / "root")
    (tmp_path / "root" / ".zgroup").write_text(json.dumps({"zarr_format": 2}))
    with pytest.raises(ImportMapError, match="a zarr group without arrays, expected one of its subgroups"):
        read_columns(tmp_path / "root", ["t"])
