"""Files that are no table of this package, by their first bytes, and what makes a table of them."""

from __future__ import annotations

from pathlib import Path

_AS_NPZ = "write its columns to NPZ with numpy.savez (docs/import.md)"
HDF5 = b"\x89HDF\r\n\x1a\n"
_KINDS: tuple[tuple[bytes, str, str], ...] = (
    (HDF5, "an HDF5 file", _AS_NPZ),
    (b"PK\x03\x04", "a spreadsheet or another zip archive", "save the sheet as CSV, or unpack it"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook", "save the sheet as CSV"),
    (b"ARROW1", "an Arrow (Feather) file", "write it as Parquet with pyarrow.parquet.write_table"),
    (b"PAR1", "a Parquet file", "call it .parquet"),
    (b"\x89MCAP", "a bag", "it needs no import: name it in place of a bag"),
    (b"SQLite format 3", "a database", "a bag (.db3) needs no import; export a table as CSV"),
    (b"\x93NUMPY", "an NPY file", "call it .npy"),
    (b"MATLAB 5.0", "a MAT file", "call it .mat"),
    (b"\x80\x04", "a pickle, which may run any program", _AS_NPZ),
    (b"\x80\x05", "a pickle, which may run any program", _AS_NPZ),
    (b"\x80\x02", "a pickle, which may run any program", _AS_NPZ),
    (b"CDF\x01", "a netCDF file", _AS_NPZ),
    (b"CDF\x02", "a netCDF file", _AS_NPZ),
)
"""First bytes, kind, and what a person can do."""
_LONGEST = max(len(start) for start, _, _ in _KINDS)


def refuse_foreign(path: Path) -> None:
    """Raise ValueError with kind and remedy for a file whose first bytes say that it is not a text."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(_LONGEST)
    for start, kind, remedy in _KINDS:
        if head.startswith(start):
            raise ValueError(f"is {kind}, expected a table: {remedy}")
