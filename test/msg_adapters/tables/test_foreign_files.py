"""Files of other formats are named with a remedy, whatever their name says."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from msg_adapters.tables.column_files import read_columns
from rsea_ros.errors import ImportMapError


@pytest.mark.parametrize(
    ("name", "head", "words"),
    [
        ("log.h5", b"\x89HDF\r\n\x1a\n", r"is an HDF5 file, expected a table: .*numpy\.savez"),
        ("log.xlsx", b"PK\x03\x04", "is a spreadsheet .* save the sheet as CSV"),
        ("log.xls", b"\xd0\xcf\x11\xe0\xa1\xb1", "is an Excel workbook, .* save the sheet as CSV"),
        ("log.feather", b"ARROW1\0\0", r"is an Arrow .* pyarrow\.parquet\.write_table"),
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


def test_a_directory_for_a_file_is_one_line(tmp_path):
    with pytest.raises(ImportMapError, match="is a directory, expected a file; only a map with `file:`"):
        read_columns(tmp_path, ["t"])
