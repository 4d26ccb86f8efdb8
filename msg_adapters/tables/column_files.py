"""Columns of numbers out of files, each format by the end of the file's name."""

from __future__ import annotations

import csv
import gzip
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from msg_adapters.tables import json_file
from msg_adapters.tables.column_table import Table
from msg_adapters.tables.foreign_files import refuse_foreign
from msg_adapters.tables.json_file import read_json
from msg_adapters.tables.mat_file import read_mat
from msg_adapters.tables.npz_file import read_npy, read_npz
from msg_adapters.tables.parquet_file import read_parquet
from msg_adapters.tables.text_file import read_text
from msg_adapters.tables.zarr_file import read_zarr
from msg_adapters.tables.zarr_store import is_group
from rsea_ros.errors import ImportMapError

READERS: Mapping[str, Callable[[Path, Sequence[str]], Table]] = {
    ".mat": read_mat,
    ".npz": read_npz,
    ".npy": read_npy,
    ".parquet": read_parquet,
    ".pq": read_parquet,
    ".zarr": read_zarr,
    ".tar": read_zarr,
    ".json": read_json,
    **dict.fromkeys(json_file.LINES, read_json),
}
"""By suffix; a file with any other is text: CSV, TSV, blanks between numbers, gzipped or not. A directory
with a .zgroup is a zarr group whatever its name."""


def read_columns(
    path: Path,
    columns: Sequence[str],
    delimiter: str | None = None,
    header: bool | None = None,
    decimal: str = ".",
) -> Table:
    """Return the requested columns.

    Text files name their columns in the first row, below a preamble at most; without names they are called
    1, 2, …. decimal: their decimal sign.
    Raises ImportMapError with file, line, column, value and expectation.
    """
    reader = read_zarr if is_group(path) else READERS.get(path.suffix.lower())
    try:
        if reader:
            return reader(path, columns)
        refuse_foreign(path)
        return read_text(path, columns, delimiter, header, decimal)
    except IsADirectoryError:
        raise ImportMapError(
            f"{path}: is a directory, expected a file; only a map with `file:` reads a directory"
        ) from None
    except (gzip.BadGzipFile, zlib.error, EOFError):
        raise ImportMapError(f"{path}: damaged or no gzip file, expected a packed table") from None
    except OSError as error:
        raise ImportMapError(f"{path}: {error.strerror or error}") from None
    except (ValueError, csv.Error) as error:
        raise ImportMapError(f"{path}: {' '.join(str(error).split())}") from None
