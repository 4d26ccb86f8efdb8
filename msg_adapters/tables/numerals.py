"""Numbers in the cells of text tables: plain decimals, Fortran's D exponents, decimal commas."""

from __future__ import annotations

import re

from rsea_ros.documents.strict_yaml import is_decimal

_FORTRAN = re.compile(r"([-+]?[0-9.]+)[dD]([-+]?[0-9]+)")
_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+([eEdD][-+]?[0-9]+)?")


def numeral(cell: str, decimal: str = ".") -> str:
    """Return a cell as a plain decimal is written; unchanged where it is no number."""
    if decimal == "," and _COMMA.fullmatch(cell):
        cell = cell.replace(",", ".")
    return _FORTRAN.sub(r"\1e\2", cell) if _FORTRAN.fullmatch(cell) else cell


def is_numeral(cell: str) -> bool:
    """Return whether a cell is a number, with a decimal comma or a D exponent too."""
    return is_decimal(numeral(cell, ","))


def has_decimal_comma(cell: str) -> bool:
    """Return whether a cell is a number with a decimal comma."""
    return bool(_COMMA.fullmatch(cell))
