"""Numbers in the cells of tables: plain decimals, Fortran's D exponents, decimal commas, ISO date-times."""

from __future__ import annotations

import re
from datetime import datetime, timedelta, timezone

from rsea_ros.documents.strict_yaml import is_decimal

_FORTRAN = re.compile(r"([-+]?[0-9.]+)[dD]([-+]?[0-9]+)")
_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+([eEdD][-+]?[0-9]+)?")
_DATE_TIME = re.compile(
    r"([0-9]{4})[-/]([0-9]{2})[-/]([0-9]{2})[T ]+([0-9]{2}):([0-9]{2}):([0-9]{2})(?:[.,]([0-9]+))?"
    r" ?(?:(?:Z|UTC|GMT)|([+-][0-9]{2}):?([0-9]{2})?)?"
)


def numeral(cell: str, decimal: str = ".") -> str:
    """Return a cell as a plain decimal is written; unchanged where it is no number."""
    if decimal == "," and _COMMA.fullmatch(cell):
        cell = cell.replace(",", ".")
    return _FORTRAN.sub(r"\1e\2", cell) if _FORTRAN.fullmatch(cell) else cell


def is_numeral(cell: str) -> bool:
    """Return whether a cell is a number, with a decimal comma or a D exponent too."""
    return is_decimal(numeral(cell, ","))


def is_datum(cell: str) -> bool:
    """Return whether a cell is a number or a date-time."""
    return is_numeral(cell) or _DATE_TIME.fullmatch(cell) is not None


def has_decimal_comma(cell: str) -> bool:
    """Return whether a cell is a number with a decimal comma."""
    return bool(_COMMA.fullmatch(cell))


def seconds_of(cell: str) -> float | None:
    """Return an ISO 8601 date-time as s since 1970, None for anything else; without a zone it is UTC.

    Raises ValueError for a date or a time that there is not.
    """
    match = _DATE_TIME.fullmatch(cell)
    if match is None:
        return None
    *fields, fraction, hours, minutes = match.groups()
    zone = timezone(timedelta(hours=int(hours or 0), minutes=int(f"{(hours or '+')[0]}{minutes or 0}")))
    try:
        year, month, day, hour, minute, second = map(int, fields)
        whole = datetime(year, month, day, hour, minute, second, tzinfo=zone).timestamp()
    except ValueError as error:
        raise ValueError(f"{error}, expected a date-time") from None
    return whole + float(f"0.{fraction or 0}")
