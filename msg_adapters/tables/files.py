"""Columns of numbers out of CSV, TSV (each also gzipped) and MAT files."""

from __future__ import annotations

import csv
import gzip
import zlib
from collections.abc import Sequence
from pathlib import Path

from msg_adapters.tables.mat_file import read_mat
from msg_adapters.tables.table import Table
from msg_adapters.tables.text_file import read_text
from rsea_ros.errors import ImportMapError


def read_columns(path: Path, columns: Sequence[str], delimiter: str | None = None) -> Table:
    """Return the columns asked for.

    Text files name their columns in the first row; without names they are called 1, 2, ….
    Raises ImportMapError with file, line, column, value and expectation.
    """
    try:
        return read_mat(path, columns) if path.suffix == ".mat" else read_text(path, columns, delimiter)
    except (gzip.BadGzipFile, zlib.error, EOFError):
        raise ImportMapError(f"{path}: damaged or no gzip file, expected a packed table") from None
    except OSError as error:
        raise ImportMapError(f"{path}: {error.strerror or error}") from None
    except (ValueError, csv.Error) as error:
        raise ImportMapError(f"{path}: {' '.join(str(error).split())}") from None
