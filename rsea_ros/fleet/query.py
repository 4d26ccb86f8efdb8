"""A store as tables of DuckDB, to be read and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

import duckdb

from rsea_ros.fleet.fleet_error import FleetError
from rsea_ros.fleet.row import ARROW
from rsea_ros.fleet.store import Store
from rsea_ros.fleet.store_keys import EXPECTED_FILES

_ANALYSES = """
CREATE VIEW analyses AS SELECT * FROM (
    FROM columns_of_a_row UNION ALL BY NAME FROM read_parquet('{pattern}', hive_partitioning = true,
        union_by_name = true, hive_types = {{'joint': VARCHAR, 'month': VARCHAR}}))
QUALIFY row_number() OVER (PARTITION BY joint, recording, model_version, settings ORDER BY written DESC) = 1
"""
_VIEWS = (
    """
CREATE VIEW recordings AS SELECT * FROM (
    FROM analyses QUALIFY row_number() OVER (PARTITION BY joint, recording ORDER BY written DESC) = 1)
QUALIFY time IS NULL OR row_number() OVER (PARTITION BY joint, bag, time ORDER BY written DESC) = 1
""",
    """
CREATE VIEW parameters AS SELECT joint, recording, time, temperature, bag, verdict, artefacts,
    p.name AS parameter, p.value AS value, p.low AS low, p.high AS high, p.unit AS unit,
    p.identifiable AS identifiable
FROM (SELECT *, UNNEST(parameters) AS p FROM recordings)
""",
    """
CREATE VIEW causes AS SELECT joint, recording, time, bag, artefacts, c.name AS cause, c.status AS status,
    c.probability AS probability, c.gain AS gain, s.name AS size, s.value AS value, s.low AS low,
    s.high AS high, s.unit AS unit
FROM (SELECT *, UNNEST(c.sizes) AS s FROM (SELECT *, UNNEST(causes) AS c FROM recordings))
""",
    """
CREATE VIEW faults AS SELECT joint, recording, time, bag, f.kind AS kind, f.count AS count, f.detail AS detail
FROM (SELECT *, UNNEST(faults) AS f FROM recordings)
""",
)
VIEWS = ("recordings", "parameters", "causes", "faults", "analyses")
_EMPTY = "No files found that match"
_VANISHED = "No such file or directory"
TRIES = 20
"""Of a query while a run merges files: each try lists them anew."""
Result = TypeVar("Result")


class NoRowsError(FleetError):
    """A store without rows."""


class MergedError(FleetError):
    """A run replaced files while they were read."""


@contextmanager
def connect(store: Store) -> Iterator[Any]:
    """Give a connection to DuckDB with the views of a store, that can read the store and write nowhere.

    Raises NoRowsError, MergedError, and FleetError for a file that is not one of rows.
    """
    rows = str(store.rows.resolve())
    pattern = f"{_quote(rows)}/joint=*/month=*/*.parquet"
    try:
        with duckdb.connect(":memory:") as database:
            database.register("no_rows", ARROW.empty_table())
            database.execute("CREATE TABLE columns_of_a_row AS FROM no_rows")
            database.execute(_ANALYSES.format(pattern=pattern))
            for view in _VIEWS:
                database.execute(view)
            database.execute("SET TimeZone = 'UTC'")
            database.execute(f"SET allowed_directories = ['{_quote(rows)}']")
            database.execute("SET enable_external_access = false")
            database.execute("SET lock_configuration = true")
            yield database
    except duckdb.Error as error:
        if _EMPTY in str(error):
            raise NoRowsError(f"{store.path}: no row, expected one: rsea fleet run makes it") from None
        if _VANISHED in str(error):
            raise MergedError(f"{store.path}: a run replaces its files, try again") from None
        text = " ".join(str(error).split("\nLINE ")[0].split())
        raise FleetError(f"{store.path}: {text}, {EXPECTED_FILES}") from None


def answer(store: Store, query: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Return column names and rows of a query. Raises FleetError for one that fails or does not just read."""
    return read_again(lambda: _answer(store, query))


def read_again(read: Callable[[], Result]) -> Result:
    """Return what `read` returns; if a run replaced files meanwhile, try again."""
    for _ in range(TRIES - 1):
        with suppress(MergedError):
            return read()
    return read()


def _answer(store: Store, query: str) -> tuple[list[str], list[tuple[Any, ...]]]:
    with connect(store) as database:
        try:
            _check_reads(duckdb.extract_statements(query))
            table = database.sql(query).to_arrow_table()
        except duckdb.IOException:
            raise
        except duckdb.Error as error:
            text = " ".join(str(error).split())
            raise FleetError(f"{text} (views: {', '.join(VIEWS)})") from None
    columns = [column.to_pylist() for column in table.columns]
    return table.column_names, list(zip(*columns, strict=True))


def _check_reads(statements: Sequence[Any]) -> None:
    """Refuse more than one statement, and one that does more than read."""
    reading = (duckdb.StatementType.SELECT, duckdb.StatementType.EXPLAIN)
    if len(statements) != 1 or statements[0].type not in reading:
        raise FleetError("expected one SELECT: only rsea fleet run changes a store")


def _quote(path: str) -> str:
    """Return a path escaped for SQL."""
    return path.replace("'", "''")
