"""The keys of an import map, expected values and defaults. docs/import.md shows them."""

from collections.abc import Iterator, Mapping, Sequence

from msg_adapters.tables.column_table import CHANNELS, FACTORS
from msg_adapters.tables.expression import FUNCTIONS
from rsea_ros.documents.strict_yaml import NEEDED, Key, table

RATES = (1e-3, 1e6)
"""Hz, of a file without stamps."""

SET_POINTS = "set_points"
"""In place of a time: a table of readings at rest."""

MAP = (
    Key("about", "text", "empty", "one line for the notes of the bag"),
    Key("time", f"mapping, `{SET_POINTS}`", NEEDED, "source of the stamps: a column and its unit, or a rate"),
    Key("where", "mapping", "all rows", "condition on the rows that are used"),
    Key("runs", "mapping", "one run", "splits a file into runs by the values of a column, one bag for each"),
    Key("header", "`true`, `false`", "detected", "whether a text file begins with column names"),
    Key(
        "delimiter",
        "`,` `;` `|` `tab` `blanks`",
        "detected from the first line",
        "separator of the cells of a text file; `blanks`: one or more blanks or tabs",
    ),
    Key("decimal", "`.` `,`", "`.`", "decimal sign of a text file: `1,5` is 1.5 where it is a comma"),
    Key("channels", "mapping", NEEDED, "for each channel a column, or a list of columns to add"),
)
TIME = (
    Key("column", "name or number of a column", "a rate", "increasing stamps, in each file"),
    Key("expression", "expression", "a column", "computed from columns, in place of one column"),
    Key("unit", "unit of time", "required without `rate`", "unit of the stamps"),
    Key("rate", f"{RATES[0]:g} to {RATES[1]:g} Hz", "a column", "sample rate of a file without stamps"),
)
RUNS = (
    Key("column", "name or number of a column", NEEDED, "the column that numbers or names the runs"),
)
WHERE = (
    Key("column", "name or number of a column", NEEDED, "the column to compare"),
    Key("from", "number, as in the file", "no limit", "keeps rows with this value or more"),
    Key("below", "number, as in the file", "no limit", "keeps rows with less than this value"),
    Key("equals", "number or text", "no limit", "keeps rows with exactly this value"),
)
TERM = (
    Key("column", "name or number of a column", "an expression", "values; `q[2]`: one of several in a cell"),
    Key("expression", "expression", "a column", "computed from columns, in place of one column"),
    Key("file", "name of a file", "FILE itself", "the file that holds the column, in the directory FILE"),
    Key("unit", "unit", NEEDED, "unit of the column; another dimension needs a scale"),
    Key("sign", "1 or -1, or one each joint", "1", "-1 reverses the axis; `[1, -1]`, `{2: -1}`: by joint"),
    Key("scale", "not 0, or one each joint", "1", "SI units of the channel per SI unit of the column"),
    Key("constant", "number, or one each joint, SI unit", "0", "added after scale and sign"),
    Key("held", "`true`, `false`", "false", "rows repeat a value until the next one arrives: keep the first"),
)
_MEANINGS = {
    "command": "commanded motor torque at the gear output; it takes effect at its stamp",
    "motor_torque": "motor torque from the measured current, at the gear output",
    "ft": "F/T sensor about the joint's axis, positive when the spring pushes the distal side forward",
    "deflection": "angle of the spring from its own encoder, with the sign of `ft`",
    "position": "angle of the gear output relative to the housing",
    "velocity": "rate of `position`",
    "reference": "target position of a controller that was active during the record",
}
CHANNEL = tuple(Key(name, dimension, "not measured", _MEANINGS[name]) for name, dimension in CHANNELS.items())
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
    for name, (_, count, meaning) in FUNCTIONS.items():
        yield f"| `{name}({', '.join('xyz'[:count])})` | {meaning} |"
