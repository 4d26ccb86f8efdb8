"""Queries of a store, and its columns."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import duckdb
import numpy as np
import numpy.typing as npt
import pyarrow as pa

from rsea_extras.fleet import FleetError
from rsea_extras.fleet.store import ARROW, EXPECTED_FILES, Store, open_store

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
            kinds = [statement.type for statement in duckdb.extract_statements(query)]
            if kinds not in ([duckdb.StatementType.SELECT], [duckdb.StatementType.EXPLAIN]):
                raise FleetError("expected one SELECT: only rsea fleet run changes a store")
            table = database.sql(query).to_arrow_table()
        except duckdb.IOException:
            raise
        except duckdb.Error as error:
            text = " ".join(str(error).split())
            raise FleetError(f"{text} (views: {', '.join(VIEWS)})") from None
    columns = [column.to_pylist() for column in table.columns]
    return table.column_names, list(zip(*columns, strict=True))


def _quote(path: str) -> str:
    return path.replace("'", "''")


Columns = dict[str, npt.NDArray[Any]]
_HISTORY = """
SELECT joint, parameter, unit, epoch(time) AS time_s, value, low, high, identifiable, temperature, recording,
       artefacts
FROM parameters ORDER BY joint, parameter, time, recording
"""
_RECORDINGS = """
SELECT joint, recording, bag, epoch(time) AS time_s, duration, temperature, outcome, reason,
       CASE WHEN diagnosis = '' THEN verdict ELSE diagnosis END AS verdict, residual, artefacts, seconds,
       peak_memory::DOUBLE AS peak_memory, faults, causes
FROM recordings ORDER BY joint, time, recording
"""


def history(store: str | Path) -> Columns:
    """Return every parameter of every recording that is done, sorted by joint, parameter and time.

    Columns, shape (n,): joint, parameter, unit, recording, artefacts (text); time_s (s since 1970, NaN where
    unknown), value, low, high (in unit), temperature (°C, NaN where unknown); identifiable (bool).
    Raises FleetError for a folder that is not a store.
    """
    return _columns(store, _HISTORY)


def recordings(store: str | Path) -> Columns:
    """Return every recording with its outcome, sorted by joint and time.

    Columns, shape (n,): those of the row that are one value (text, float; time_s as in history; verdict: of
    the diagnosis where there is one); faults and causes: a list of dicts each, as in the row.
    Raises FleetError for a folder that is not a store.
    """
    return _columns(store, _RECORDINGS)


def _columns(store: str | Path, query: str) -> Columns:
    opened = open_store(store)

    def read() -> pa.Table:
        with connect(opened) as database:
            return database.sql(query).to_arrow_table()

    table = read_again(read)
    return {name: _plain(table[name].combine_chunks()) for name in table.column_names}


def _plain(column: pa.Array) -> npt.NDArray[Any]:
    """Return a column as numpy has it: NaN, false or empty text where the store has no value."""
    if pa.types.is_floating(column.type):
        return np.asarray(column.fill_null(np.nan), np.float64)
    if pa.types.is_boolean(column.type):
        return np.asarray(column.fill_null(False), np.bool_)
    values = np.empty(len(column), object)
    none: Any = "" if pa.types.is_string(column.type) else []
    values[:] = [none if value is None else value for value in column.to_pylist()]
    return values
