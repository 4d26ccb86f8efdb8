"""`rsea fleet sql`: query a store with DuckDB."""

import argparse
import csv
import json
import sys
from datetime import date, datetime
from typing import Any

from rsea_ros.cli._terminal import columns
from rsea_ros.report.result_files import strict

_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_WIDEST = 60
"""Largest width of a cell on a terminal, characters."""


def add_sql(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of `sql`."""
    parser.add_argument(
        "query", help="SELECT … FROM recordings, parameters, causes, faults or analyses (docs/fleet.md)"
    )
    parser.add_argument("--store", required=True, help="folder of the store")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="print a list of JSON objects")
    form.add_argument("--csv", action="store_true", help="print CSV: a line of names, then one line per row")


def run(args: argparse.Namespace) -> int:
    """Print the answer."""
    from rsea_ros.fleet.query import answer
    from rsea_ros.fleet.store import open_store

    names, rows = answer(open_store(args.store), args.query)
    if args.json:
        print(_json([dict(zip(names, row, strict=True)) for row in rows], indent=1))
    elif args.csv:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(map(no_formula, names))
        writer.writerows([no_formula(value) for value in row] for row in rows)
    else:
        print(columns([names, *([_cell(value) for value in row] for row in rows)]))
    return 0


def no_formula(value: Any) -> str:
    """Return a value in full; a text that a spreadsheet would run begins with an apostrophe."""
    text = _text(value)
    return f"'{text}" if isinstance(value, str) and text.startswith(_FORMULA) else text


def _json(value: Any, indent: int | None = None) -> str:
    return json.dumps(strict(value), default=_other, indent=indent, allow_nan=False, ensure_ascii=False)


def _other(value: Any) -> str:
    return value.isoformat() if isinstance(value, date) else str(value)


def _text(value: Any) -> str:
    plain = strict(value)
    if plain is None:
        return ""
    return _json(plain) if isinstance(plain, (bool, int, float, list, dict)) else _other(plain)


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, datetime):
        return value.strftime("%Y-%m-%d %H:%M:%S")
    text = " ".join(_text(value).split())
    return text if len(text) <= _WIDEST else f"{text[: _WIDEST - 1]}…"
