"""`rsea fleet sql`: query a store with DuckDB."""

import argparse
import csv
import json
import sys
from collections.abc import Sequence
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
        objects = [dict(zip(names, map(_plain, row), strict=True)) for row in rows]
        print(json.dumps(objects, indent=1, allow_nan=False, ensure_ascii=False))
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


def _plain(value: Any) -> Any:
    if isinstance(value, (datetime, date)):
        return value.isoformat()
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        return [_plain(item) for item in value]
    return strict(value) if isinstance(value, (int, float, str, bool)) or value is None else str(value)


def _text(value: Any) -> str:
    plain = _plain(value)
    if plain is None:
        return ""
    return plain if isinstance(plain, str) else json.dumps(plain, ensure_ascii=False)


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, datetime):
        return value.strftime("%Y-%m-%d %H:%M:%S")
    text = " ".join(_text(value).split())
    return text if len(text) <= _WIDEST else f"{text[: _WIDEST - 1]}…"
