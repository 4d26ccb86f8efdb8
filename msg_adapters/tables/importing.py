"""Measurements of real machines to records."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np

from msg_adapters.tables.column_files import read_columns
from msg_adapters.tables.column_table import CHANNELS, LINEAR, Table, canonical, unit
from msg_adapters.tables.import_map import ChannelTerm, ImportMap, RowFilter
from msg_adapters.tables.raw_codes import raw_code
from rsea_ros.documents.strict_yaml import is_decimal
from rsea_ros.documents.units import in_motion, plain
from rsea_ros.documents.wording import list_names, quote
from rsea_ros.errors import ImportMapError
from rsea_ros.records.record import COMMANDS, IMPORTED, UNITS, BoolArray, Channel, Fault, FloatArray, Record
from rsea_ros.records.stamp_order import GAP, jumps_back
from rsea_ros.records.stamps import even_behind_ticks

SET_POINTS = (
    "static readings, without the commands, one a second in the bag: `identify` and `diagnose` need the"
    " record of a motion; a stiffness found here goes into its rig"
)
_ORDER = ("deflection", "position", "command", "motor_torque", "ft")
"""A channel over those before it."""
_FEWEST, _NORMAL = 4, 1.96


def static_lines(record: Record) -> Iterator[str]:
    """Yield the line through each two channels of readings at rest, y = slope x + offset, with 95 %.

    Of ft over deflection the slope is the spring's stiffness. Source: ordinary least squares.
    """
    for x, y in combinations([name for name in _ORDER if name in record], 2):
        at, readings = record[x], record[y]
        if len(at) != len(readings) or len(at) < _FEWEST or np.ptp(at.y) == 0.0:
            continue
        (slope, offset), covariance = np.polyfit(at.y, readings.y, 1, cov=True)
        off = float(np.abs(readings.y - slope * at.y - offset).max())
        unit, per = plain(UNITS[y]), plain(UNITS[x])
        ratio = "" if unit == per else f" {unit}/{per}"
        half = _NORMAL * float(covariance[0, 0]) ** 0.5
        yield (
            f"{y} over {x}: {slope:.6g} ± {half:.2g}{ratio}, {offset:.3g} {unit} at zero,"
            f" readings up to {off:.2g} {unit} off the line"
        )


UNDATED = 1e8
"""Stamps below this (s, three years after 1970) have no date: the file's clock starts near zero."""
START_NS = 1_000_000_000
"""Where an undated record starts: a stamp of zero would mean `not set`."""
MOST_RUNS = 10_000
"""Of a file: a bag each."""
_MOST_NAMED = 20
LATEST = 2.0**31
"""s. The seconds of a message's stamp are a signed integer of 32 bits."""


@dataclass(frozen=True)
class Imported:
    """A record, and which joint and which run of the file it is: None where there is one of them only."""

    record: Record
    mapping: ImportMap
    index: int | None = None
    run: float | str | None = None

    @property
    def name(self) -> str:
        """Its suffix among the others of the same file: `-joint2-run7`, `-joint2-chirp`."""
        joint = "" if self.index is None else f"-joint{self.index}"
        if isinstance(self.run, str):
            return f"{joint}-{re.sub('[^-.0-9A-Za-z]+', '_', self.run)}"
        return joint + ("" if self.run is None else f"-run{self.run:.15g}")


@dataclass(frozen=True)
class _Part:
    """The content of one file: stamps of the valid rows, s, values by channel, and faults."""

    t: FloatArray
    values: Mapping[str, FloatArray]
    notes: tuple[str, ...]
    faults: tuple[Fault, ...]


def import_record(path: str | Path, mapping: ImportMap, index: int | None = None) -> Record:
    """Read a measurement of one run as its map says; the record's notes list the repairs.

    path: a file, or the directory of the files that the map names. index: of the joint, from 0, where cells
    hold several. Raises ImportMapError with file, row, column, value and expectation.
    """
    imported = list(import_records(path, mapping, (index,)))
    if len(imported) > 1:
        raise ImportMapError(f"{path}: {len(imported)} runs in {mapping.runs}, expected one")
    return imported[0].record


def import_records(
    path: str | Path, mapping: ImportMap, indices: Sequence[int | None] = (None,)
) -> Iterator[Imported]:
    """Yield a record for each joint of `indices` and each run of the file, which is read once.

    Raises as import_record does.
    """
    maps = [mapping.at(index) for index in indices]
    files = {name: _file(Path(path), name, mapping) for name in mapping.files}
    tables = {name: _table(file, name, maps) for name, file in files.items()}
    for index, joint in zip(indices, maps, strict=True):
        for run in _runs(path, tables, joint):
            parts = [p for name in tables for p in _parts(files[name], tables[name], joint, name, run)]
            with _name_errors(path, mapping, run):
                record = _record(path, parts, joint)
            yield Imported(record, joint, index, run)


@contextmanager
def _name_errors(path: str | Path, mapping: ImportMap, run: float | str | None) -> Iterator[None]:
    where = f"{path}" if run is None else f"{path}: {mapping.runs} = {_text(run)}"
    try:
        yield
    except ValueError as error:
        raise ImportMapError(f"{where}: {error}") from None


def _file(path: Path, name: str, mapping: ImportMap) -> Path:
    if name and not path.is_dir():
        names = ", ".join(mapping.files)
        raise ImportMapError(f"{path}: no directory, expected the one that holds {names}")
    return path / name if name else path


def _table(path: Path, name: str, maps: Sequence[ImportMap]) -> Table:
    columns = dict.fromkeys(column for mapping in maps for column in mapping.of_file(name).columns())
    labels = frozenset(label for mapping in maps for label in mapping.labels)
    one = maps[0]
    stamps = frozenset(one.time.columns if one.time else ())
    text = {"delimiter": one.delimiter, "header": one.header, "decimal": one.decimal}
    return read_columns(path, list(columns), labels=labels, stamps=stamps, **text)


def _text(run: float | str) -> str:
    return run if isinstance(run, str) else f"{run:.15g}"


def _runs(
    path: str | Path, tables: Mapping[str, Table], mapping: ImportMap
) -> Sequence[float | str | None]:
    if mapping.runs is None:
        return [None]
    table = next(iter(tables.values()))
    runs = np.unique(table.values(mapping.runs)[table.given(mapping.runs)])
    if not 0 < len(runs) <= MOST_RUNS:
        raise ImportMapError(f"{path}: {len(runs)} values in {mapping.runs}, expected 1 to {MOST_RUNS} runs")
    return [str(run) if runs.dtype.kind == "U" else float(run) for run in runs]


def _parts(
    path: Path, table: Table, mapping: ImportMap, file: str, run: float | str | None
) -> Iterator[_Part]:
    """Yield what one file holds, by streams: an outer join of several is as many tables."""
    mapping = mapping.of_file(file)
    with _name_errors(path, mapping, run):
        keep, undated = _rows_kept(table, mapping, run)
        codes = [f for name, terms in mapping.channels.items() for f in _codes(name, table, terms, keep)]
        kept = {n: terms for n, terms in mapping.channels.items() if n not in {f.channel for f in codes}}
        if not kept:
            raise ImportMapError(f"no channel is left: {codes[0].channel}: {codes[0].detail}")
        streams = _streams(table, kept, keep) if mapping.time else [(tuple(kept), np.ones_like(keep))]
        notes, faults = table.notes, (*_rows_left_out(path, table, undated), *codes)
        if len(streams) > 1:
            of = "; ".join(", ".join(names) for names, _ in streams)
            notes += (f"{len(streams)} streams, each in rows of its own: {of}",)
        for names, rows in streams:
            columns = [column for name in names for term in kept[name] for column in term.columns]
            at, stamps, counters, repairs = _stamps(path, table, mapping, keep & rows, rows, columns)
            values = {name: _values(table, kept[name], at, stamps) for name in names}
            yield _Part(stamps, values, (*notes, *counters), (*faults, *repairs))
            notes, faults = (), ()


def _streams(
    table: Table, channels: Mapping[str, Sequence[ChannelTerm]], keep: BoolArray
) -> list[tuple[tuple[str, ...], BoolArray]]:
    """Return the channels that share at least half of their rows, and the rows in which one has a value.

    A cell is missing only where the row holds another of its stream; without another stream, in any row.
    """
    streams: list[tuple[tuple[str, ...], BoolArray]] = []
    for name, terms in channels.items():
        own = keep & np.logical_and.reduce([table.given(column) for term in terms for column in term.columns])
        same = [s for s in streams if 2 * np.sum(s[1] & own) >= min(np.sum(s[1]), np.sum(own)) - 1]
        names = (*(n for s in same for n in s[0]), name)
        streams = [s for s in streams if s[0][0] not in names]
        streams.append((names, np.logical_or.reduce([own, *(rows for _, rows in same)])))
    return streams if len(streams) > 1 else [(tuple(channels), np.ones_like(keep))]


def _codes(name: str, table: Table, terms: Sequence[ChannelTerm], keep: BoolArray) -> Iterator[Fault]:
    """Yield the fault of a channel that takes a device's codes for numbers."""
    for term in terms:
        is_angle = CHANNELS[name] == "angle" and unit(term.unit)[0] not in LINEAR
        is_read = term.expression is not None and term.expression.decodes
        for column in () if is_read else term.columns:
            values = table[column][keep]
            code = raw_code(column, values, term.gain if is_angle and term.expression is None else None)
            if code is not None:
                held = f"{column} holds {code[0]}, {np.nanmin(values):.0f} to {np.nanmax(values):.0f}"
                yield Fault("raw_codes", name, 1.0, f"left out: {held}; in the map: {code[1]}")
                return


def _record(path: str | Path, parts: Sequence[_Part], mapping: ImportMap) -> Record:
    start, stop = min(float(p.t[0]) for p in parts), max(float(p.t[-1]) for p in parts)
    epoch = round(start * 1e9) if start > UNDATED else START_NS
    if not epoch * 1e-9 + stop - start < LATEST:
        raise ImportMapError(
            f"stamps from {start:g} s to {stop:g} s, expected less than {LATEST:g} s:"
            " is it another unit of time?"
        )
    channels, faults = {}, [fault for part in parts for fault in part.faults]
    columns = [(name, part.t - start, y) for part in parts for name, y in part.values.items()]
    for name, t, y in columns:
        channels[name], lost = _channel(name, t, y, mapping.channels[name])
        if any(term.held for term in mapping.channels[name]):
            channel = channels[name]
            new = np.diff(channel.y, prepend=np.nan) != 0.0
            if np.count_nonzero(new) < 2:
                raise ImportMapError(f"{name} is held at {channel.y[0]:g}, expected values that change")
            channels[name] = Channel(channel.t[new], channel.y[new])
        faults += lost
    lines = [f"{fault.channel}: {fault.detail}" for fault in faults]
    if mapping.set_points:
        lines += [SET_POINTS, *static_lines(Record(channels))]
        channels = {name: held for name, held in channels.items() if name not in COMMANDS}
    notes = (
        f"{IMPORTED}{Path(path).name}, {mapping.path.name}: {mapping.about}".rstrip(": "),
        *(note for part in parts for note in part.notes),
        *lines,
    )
    return Record(channels, str(path), epoch, tuple(filter(None, notes)), tuple(faults))


def summary(record: Record, mapping: ImportMap) -> list[str]:
    """Return a summary of the import, for a person to compare with the machine."""
    lines = list(record.notes)
    linear = any(unit(term.unit)[0] in LINEAR for terms in mapping.channels.values() for term in terms)
    for name, channel in record.channels.items():
        terms = mapping.channels[name]
        columns = " + ".join(f"{term.column} [{plain(canonical(term.unit)) or 1}]" for term in terms)
        span = f"{channel.y.min():.6g} to {channel.y.max():.6g}"
        si = plain(in_motion(UNITS[name], linear=linear))
        lines.append(f"{name}: {len(channel)} samples of {columns}, {span} {si}")
    if record.driving is None and not mapping.set_points:
        lines.append(
            "no command: `check` compares the channels; for `identify` and `diagnose` map the commanded"
            " torque or current as `command`, or the measured one where no other was logged (docs/import.md)"
        )
    return lines


def _rows_kept(table: Table, mapping: ImportMap, run: float | str | None) -> tuple[BoolArray, int]:
    """Return which rows count, and how many are left out without a stamp or by `where`."""
    keep = np.ones(len(next(iter(table.columns.values()))), np.bool_)
    where = mapping.where
    for column in (*(mapping.time.columns if mapping.time else ()), *([where.column] if where else [])):
        keep &= table.given(column)
    undated = int(np.count_nonzero(~keep))
    if mapping.runs is not None:
        keep &= table.values(mapping.runs) == run
    if where is not None:
        keep &= _chosen(table, where)
    if np.count_nonzero(keep) < 2:
        left = "" if where is None else f" left by where{_held(table, where)}"
        raise ImportMapError(f"fewer than two rows{left}, expected a record")
    if table.trials is not None and (count := len(np.unique(table.trials[1][keep]))) > 1:
        name = table.trials[0]
        raise ImportMapError(
            f"rows of {count} trials, expected one: `runs: {{column: {name}}}` in the map makes a bag each,"
            f" `where: {{column: {name}, equals: 1}}` takes the first"
        )
    return keep, undated


def _chosen(table: Table, where: RowFilter) -> BoolArray:
    """Return the rows that a condition keeps. Raises ImportMapError for a limit of texts."""
    if where.column in table.labels:
        if where.start is not None or where.stop is not None:
            raise ImportMapError(f"where: {where.column} holds texts{_held(table, where)}, expected equals")
        assert where.equals is not None
        return np.asarray(table.labels[where.column] == _text(where.equals))
    values = table[where.column]
    keep = np.ones(len(values), np.bool_)
    keep &= values >= where.start if where.start is not None else True
    keep &= values < where.stop if where.stop is not None else True
    if isinstance(where.equals, str) and not is_decimal(where.equals):
        raise ImportMapError(f"where.equals is {where.equals!r}, expected a number{_held(table, where)}")
    return keep & (values == float(where.equals)) if where.equals is not None else keep


def _held(table: Table, where: RowFilter) -> str:
    """Return what is in the column of a condition, for people."""
    values = table.values(where.column)[table.given(where.column)]
    if not values.size:
        return f" ({where.column} is empty)"
    if values.dtype.kind == "U":
        texts = [quote(str(text)) for text in np.unique(values)[:_MOST_NAMED]]
        return f" ({where.column} is {list_names(texts, 'or')})"
    return f" ({where.column} goes from {values.min():g} to {values.max():g})"


def _rows_left_out(path: str | Path, table: Table, undated: int) -> Iterator[Fault]:
    for count, why in ((table.left_out, table.first), (undated, "no stamp, or no value to choose rows by")):
        if count:
            detail = f"{count} of {table.rows} rows left out: {why}"
            yield Fault("rows_left_out", Path(path).name, count / table.rows, detail)


def _channel(
    name: str, t: FloatArray, y: FloatArray, terms: Sequence[ChannelTerm]
) -> tuple[Channel, list[Fault]]:
    columns = " + ".join(term.column for term in terms)
    if np.isinf(y).any():
        raise ImportMapError(f"{name}: {columns} is too large for its unit, expected a number below 1e308")
    missing = np.isnan(y)
    channel = Channel(t[~missing], y[~missing])
    if len(channel) < 2:
        raise ImportMapError(f"{name}: {columns} has {len(channel)} values, expected a number in most rows")
    count, first = int(missing.sum()), float(t[np.argmax(missing)])
    if count > _MOST * len(y):
        count, first = _lacking(channel.t, t) or (count, first)
    whole = len(channel) + count
    detail = f"{count} of {whole} values of {columns} are missing, the first at {first:.6g} s"
    return channel, [Fault("missing_values", name, count / whole, detail)] if count else []


_MOST, _OFTEN = 0.4, 0.02
"""Share of empty cells above which a column may be that of a slower sensor, and of its steps, or its values,
that such a one lacks without being told, at the most."""


def _lacking(t: FloatArray, rows: FloatArray) -> tuple[int, float] | None:
    """Return how many values a column lacks that has some evenly (t) among rows, and from when on, s."""
    step = np.diff(t, prepend=rows[0], append=rows[-1])
    period = float(np.median(step))
    if np.mean(step > GAP * period) > _OFTEN:
        return None
    count, begins = int((rows[-1] - rows[0]) / period) - len(t), np.append(rows[0], t)
    return (count if count > _OFTEN * len(t) else 0), float(begins[np.argmax(step > GAP * period)])


def _stamps(
    path: Path, table: Table, mapping: ImportMap, keep: BoolArray, rows: BoolArray, columns: Sequence[str]
) -> tuple[np.ndarray, FloatArray, list[str], list[Fault]]:
    """Return the valid rows in order, their stamps, s, increasing, notes, and faults of the stamps.

    Stamps that repeat are spread over all dated rows of a run, those that `where` leaves out included.
    rows, columns: of the stream.
    """
    if mapping.time is None:
        start = int(np.argmax(keep)) if mapping.runs is not None else 0
        return np.flatnonzero(keep), (np.flatnonzero(keep) - start) / float(mapping.rate or 1.0), [], []
    whole = np.logical_and.reduce([rows, *(~np.isnan(table[column]) for column in mapping.time.columns)])
    for labels in [mapping.runs] if mapping.runs is not None else []:
        whole &= table.values(labels) == table.values(labels)[np.argmax(keep)]
    if table.trials is not None:
        whole &= table.trials[1] == table.trials[1][np.argmax(keep)]
    if mapping.time.column in table.dated and canonical(mapping.time.unit) != "s":
        raise ImportMapError(
            f"time.unit is {mapping.time.unit!r}, and {mapping.time.column} holds date-times, expected s"
        )
    dated = np.flatnonzero(whole)
    counted = {column: without_wraps(table[column][dated]) for column in mapping.time.columns}
    ticks = replace(table, columns={column: x for column, (x, _) in counted.items()})
    t = _values(ticks, (mapping.time,), np.arange(len(dated)), dated.astype(np.float64))
    notes = [f"{column} {note}" for column, (_, note) in counted.items() if note]
    faults = []
    if (jumps := np.flatnonzero(jumps_back(t)) + 1).size:
        at, starts = jumps[0], ", ".join(str(dated[k] + 1) for k in jumps[:_MOST_NAMED])
        steps = f"{t[at]:.6f} s after {t[at - 1]:.6f} s"
        raise ImportMapError(
            f"{mapping.time.column} of row {dated[at] + 1} goes back ({steps}), expected one run: make a file"
            f" of the rows from {starts} on, or name the column that numbers the runs, `runs: {{column: …}}`"
        )
    if (back := np.diff(t) < 0.0).any():
        order = np.argsort(t, kind="stable")
        rough = [[np.nansum(np.abs(np.diff(table[c][k], 2))) for c in columns] for k in (dated[order], dated)]
        smooth = sum(new / old - 1.0 for new, old in zip(*rough, strict=True) if old) <= 0.0
        what = "rows sorted by them" if smooth else "the stamps alone are sorted, the values are in order"
        detail = f"{back.sum()} of {len(t)} stamps go back, the first at {t[1:][back][0]:.6g} s: {what}"
        faults.append(Fault("out_of_order", path.name, float(back.mean()), detail))
        dated, t = dated[order] if smooth else dated, t[order]
    if t[-1] == t[0]:
        raise ImportMapError(f"{mapping.time.column} is {t[0]:g} s in every row, expected a clock that runs")
    spread, detail = spread_repeats(t)
    share, inside = float(np.mean(np.diff(t, prepend=-np.inf) == 0.0)), keep[dated]
    faults += [Fault("coarse_stamps", path.name, share, detail)] if detail else []
    return dated[inside], spread[inside], notes, faults


_COUNTERS, _NEAR = [2.0**bits * 10.0**-places for bits in (16, 32) for places in (0, 3, 6, 9)], 5.0
"""Where counters of 16 and 32 bits begin anew, also of ms, µs, ns made s; usual steps that they go then."""


@np.errstate(over="ignore")  # a stamp of 1e308 is told where the record is made
def without_wraps(x: FloatArray) -> tuple[FloatArray, str]:
    """Return stamps as the counter without an end would have them, and a note on one that began anew."""
    step = np.diff(x, prepend=x[0])
    usual = float(np.median(step[step > 0.0])) if np.any(step > 0.0) else 0.0
    for span in _COUNTERS if np.any(step < 0.0) else ():
        turns = np.rint(step / span)
        turns[np.abs(step - turns * span) > _NEAR * usual] = 0.0
        if np.any(turns < 0.0) and np.ptp(x) <= span:
            note = f"begins anew at {span:.10g}, as a counter does ({np.sum(turns < 0.0)} times): unwrapped"
            return x - span * np.cumsum(turns), note
    return x, ""


def _values(table: Table, terms: Sequence[ChannelTerm], keep: np.ndarray, t: FloatArray) -> FloatArray:
    """Return a channel in the rows that count. t: their stamps, s. Raises ValueError for an expression."""
    total = np.zeros(len(t))
    with np.errstate(over="ignore", invalid="ignore"):
        for term in terms:
            if term.expression is None:
                values = table[term.column][keep]
            else:
                values = term.expression.values({name: table[name][keep] for name in term.columns}, t)
            values *= term.gain
            values += term.constant
            total += values
    return total


LONG = 1.5
"""Where the clock moved this many times its usual tick, whole ticks passed without a sample."""


def spread_repeats(t: FloatArray) -> tuple[FloatArray, str]:
    """Spread samples with equal stamps evenly until the clock's next tick; return a note.

    Where all stamps fit one even clock, that is used. Otherwise the first sample after a tick is dated by it
    to within one sample period, so the error of each stamp stays below that, whatever the rate does
    meanwhile; a line through all samples would be off by as much as the rate wanders.
    t: s, shape (n,), not decreasing. Returns t unchanged where no stamp repeats.
    """
    first = np.flatnonzero(np.diff(t, prepend=-np.inf))
    if len(first) == len(t) or len(first) < 2:
        return t, ""
    repeats = f"{len(t) - len(first)} of {len(t)} stamps repeat"
    even = even_behind_ticks(t)
    if even is not None:
        rate = 1.0 / (even[1] - even[0])
        return even, f"{repeats}: samples dated by the even clock that they fit, {rate:.4g} Hz"
    counts = np.diff(first, append=len(t))
    spans = np.diff(t[first])
    tick = float(np.median(spans))
    spans = np.append(np.where(spans > LONG * tick, tick, spans), tick)
    steps = spans / counts
    steps[-1] = min(steps[-2:])
    place = np.arange(len(t)) - np.repeat(first, counts)
    spread = t + place * np.repeat(steps, counts)
    if np.median(counts) > 1:  # the recording began within a tick
        spread[: counts[0]] = spread[first[1]] - (counts[0] - place[: counts[0]]) * min(steps[:2])
    slow, fast = 1.0 / np.quantile(steps, [0.95, 0.05])
    return spread, (
        f"{repeats} (clock of {tick * 1e3:.3g} ms):"
        f" samples spread evenly between its ticks, {slow:.0f} to {fast:.0f} Hz"
    )
