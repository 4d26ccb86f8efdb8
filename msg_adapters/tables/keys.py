"""The keys of an import map: what each expects, and what holds without it. docs/import.md shows them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from msg_adapters.tables.expression import FUNCTIONS
from msg_adapters.tables.units import CHANNELS, FACTORS
from rsea_ros.keys import NEEDED, Key, table

RATES = (1e-3, 1e6)
"""Hz, of a file without stamps."""

MAP = (
    Key("about", "text", "empty", "one line that goes into the bag's notes"),
    Key("time", "mapping", NEEDED, "where the stamps come from: a column with its unit, or a rate"),
    Key("where", "mapping", "all rows", "which rows count"),
    Key("runs", "mapping", "one run", "a file of several runs: each value of a column is one, a bag each"),
    Key("header", "`true`, `false`", "as the line looks", "whether the first line of a text has names"),
    Key(
        "delimiter",
        "`,` `;` `|` `tab` `blanks`",
        "seen from the first line",
        "what parts the cells of a text; `blanks`: one or several blanks or tabs",
    ),
    Key("channels", "mapping", NEEDED, "a column, or a list of columns that are summed, for each channel"),
)
TIME = (
    Key("column", "name or number of a column", "a rate", "the stamps, increasing, of each file"),
    Key("expression", "expression", "a column", "of columns, instead of one"),
    Key("unit", "unit of time", "needed but with a rate", "of the stamps"),
    Key("rate", f"{RATES[0]:g} to {RATES[1]:g} Hz", "a column", "samples a second, of a file without stamps"),
)
RUNS = (
    Key("column", "name or number of a column", NEEDED, "the column that counts the runs"),
)
WHERE = (
    Key("column", "name or number of a column", NEEDED, "the column that chooses"),
    Key("from", "number, as in the file", "no limit", "rows with this value or more"),
    Key("below", "number, as in the file", "no limit", "rows with less than this value"),
    Key("equals", "number, as in the file", "no limit", "rows with exactly this value"),
)
TERM = (
    Key("column", "name or number of a column", "an expression", "measured values; `q[2]`: one of several"),
    Key("expression", "expression", "a column", "of columns, instead of one"),
    Key("file", "name of a file", "FILE itself", "that holds it, in the directory FILE"),
    Key("unit", "unit", NEEDED, "of the column; another dimension than the channel's needs a scale"),
    Key("sign", "1 or -1", "1", "-1 turns the axis"),
    Key("scale", "number other than 0", "1", "SI unit of the channel for each SI unit of the column"),
    Key("constant", "number, SI unit of the channel", "0", "added after scale and sign"),
)
CHANNEL = tuple(Key(name, dimension, "not measured") for name, dimension in CHANNELS.items())
SECTIONS: Mapping[str, Sequence[Key]] = {
    "map": MAP,
    "time": TIME,
    "where": WHERE,
    "runs": RUNS,
    "channels": CHANNEL,
    "channels.NAME": TERM,
}


def tables() -> str:
    """Return the tables of docs/import.md in Markdown: all keys, all units, the functions of expressions."""
    rows = [f"| {name} | {', '.join(f'`{unit}`' for unit in factors)} |" for name, factors in FACTORS.items()]
    units = "\n".join(["| dimension | units |", "|---|---|", *rows])
    functions = "\n".join(["| function | is |", "|---|---|", *_functions()])
    sections = (table(section, keys) for section, keys in SECTIONS.items())
    return "\n".join([*sections, units, "", functions]) + "\n"


def _functions() -> Iterator[str]:
    """Yield a row for each function of an expression."""
    for name, (_, count, meaning) in FUNCTIONS.items():
        yield f"| `{name}({', '.join('xyz'[:count])})` | {meaning} |"
