"""Import maps: units and signs by numbers worked out by hand, and every nonsense refused by name."""

import math
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from map_files import CSV, MAP

from msg_adapters.tables import import_map, import_record, load_map
from msg_adapters.tables.column_table import FACTORS
from msg_adapters.tables.expression import FUNCTIONS
from rsea_ros.documents.strict_yaml import table
from rsea_ros.errors import ImportMapError


def test_units_signs_scales_and_sums_are_applied(files):
    record = files()
    assert np.allclose(record["position"].y, [-math.pi / 2, math.pi / 4, 0.0])
    assert np.allclose(record["command"].y, [1.5 * 6.8 + 2.5, -0.5 * 6.8 + 4.5, 6.5])
    assert record["command"].t.tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize(
    ("unit", "value"),
    [
        ("rev", 2 * math.pi),
        ("arcmin", math.pi / 10800),
        ("mrad", 1e-3),
        ("rad", 1.0),
        ("m", 1.0),
        ("mm", 1e-3),
    ],
)
def test_positions_are_converted_from_their_unit(files, unit, value):
    text = f"time: {{rate: 100}}\nchannels: {{position: {{column: phi, unit: {unit}}}}}"
    record = files(text)
    assert np.allclose(record["position"].y, np.array([90, -45, 0]) * value)
    assert np.allclose(record["position"].t, [0.0, 0.01, 0.02])


@pytest.mark.parametrize(
    ("where", "kept"),
    [
        ("below: 5", [2.0, 4.0]),
        ("from: 4", [4.0, 6.0]),
        ("from: 3, below: 7", [4.0, 6.0]),
        ("equals: 0", [4.0, 6.0]),
    ],
)
def test_only_rows_that_match_are_read(files, where, kept):
    column = "load" if "equals" not in where else "flag"
    csv = (
        CSV.replace("load\n", "load,flag\n")
        .replace(",2\n", ",2,1\n")
        .replace(",4\n", ",4,0\n")
        .replace(",6\n", ",6,0\n")
    )
    text = f"where: {{column: {column}, {where}}}\n{MAP.replace('constant: 0.5', 'constant: 0')}"
    record = files(text.replace("{column: i, unit: mA, scale: 6.8}, ", ""), csv)
    assert record["command"].y.tolist() == kept


def test_separators_comments_and_missing_names_are_read(files):
    assert np.allclose(files(MAP, CSV.replace(",", "\t"), "run.tsv")["position"].y[0], -math.pi / 2)
    assert np.allclose(files(f'delimiter: ";"\n{MAP}', CSV.replace(",", ";"))["position"].y[0], -math.pi / 2)
    assert np.allclose(files(MAP, f"# a comment\n{CSV}\n")["position"].y[0], -math.pi / 2)
    numbered = (
        MAP.replace("column: t", "column: 1").replace("phi", "2").replace("i,", "3,").replace("load", "4")
    )
    assert np.allclose(files(numbered, CSV.partition("\n")[2])["position"].y[0], -math.pi / 2)


LONG = "t,phi,i,load\n" + "".join(f"{k * 0.01:.2f},{k},{k},{k}\n" for k in range(100))
DEGREE = math.pi / 180


@pytest.mark.parametrize("missing", ["", "nan", "NaN", "n/a", "-", " NULL "])
def test_missing_values_are_left_out_of_their_channel_and_counted(files, missing):
    record = files(MAP, LONG.replace("0.07,7,", f"0.07,{missing},").replace("0.50,50,", f"0.50,{missing},"))
    assert len(record["position"]) == 98 and len(record["command"]) == 100
    assert np.allclose(record["position"].t[6:8], [0.06, 0.08])
    (fault,) = record.faults
    assert (fault.kind, fault.channel, fault.share) == ("missing_values", "position", 0.02)
    assert fault.detail == "2 of 100 values of phi are missing, the first at 0.07 s"
    assert f"position: {fault.detail}" in record.notes


@pytest.mark.parametrize(("row", "told"), [("0.50,50,50\n", 3), ("0.50,50,50,50,50\n", 5), ("0.5\n", 1)])
def test_rows_of_another_length_are_left_out_and_counted(files, row, told):
    record = files(MAP, LONG.replace("0.50,50,50,50\n", row))
    assert len(record["position"]) == 99
    (fault,) = record.faults
    assert (fault.kind, fault.channel, fault.share) == ("rows_left_out", "run.csv", 0.01)
    assert fault.detail == f"1 of 100 rows left out: line 52 has {told} fields, expected 4"


SPACED = "".join(f"  {k * 0.01:10.4f}   {k:8.3f} {k:e}\t{k}  \n" for k in range(5))


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("t phi i load\n" + SPACED, "run.csv"),
        ("t phi i load\n" + SPACED, "run.txt"),
        ("  t    phi    i   load\n" + SPACED, "run.tsv"),
        ("t\tphi\ti\tload\t\n" + "".join(f"{k}\t{k}\t{k}\t{k}\t\n" for k in range(5)), "run.tsv"),
        ("t\tphi\ti\tload\n" + "".join(f"{k}\t{k}\t{k}\t{k}\t\n" for k in range(5)), "run.csv"),
        ("t;phi;i;load;\n" + "".join(f"{k};{k};{k};{k};\n" for k in range(5)), "run.csv"),
        ("t, phi, i, load,\r\n" + "".join(f"{k}, {k}, {k}, {k}\r\n" for k in range(5)), "run.csv"),
        ('"t","phi","i","load"\n' + "".join(f'"{k}","{k}",{k},"{k}"\n' for k in range(5)), "run.csv"),
        ('"a, b","t","phi","i","load"\n' + "".join(f'"x, y",{k},{k},{k},{k}\n' for k in range(5)), "run.csv"),
        ("t|phi|i|load\r" + "".join(f"{k}|{k}|{k}|{k}\r" for k in range(5)), "run.csv"),
        ("load,i,junk,phi,t\n" + "".join(f"{k},{k},text,{k},{k}\n" for k in range(5)), "run.csv"),
    ],
)
def test_the_separator_of_cells_is_recognised(files, text, name):
    record = files(MAP, text, name)
    assert np.allclose(record["position"].y, -np.arange(5) * DEGREE)
    assert not record.faults


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1"])
def test_common_encodings_are_read(files, tmp_path, encoding):
    (tmp_path / "run.csv").write_bytes(CSV.replace("phi", "phi [°]").encode(encoding))
    (tmp_path / "map.yaml").write_text(MAP.replace("column: phi", 'column: "phi [°]"'))
    if encoding == "utf-16-le":  # without its mark
        with pytest.raises(ImportMapError, match=r"not a text .it has zero bytes"):
            import_record(tmp_path / "run.csv", load_map(tmp_path / "map.yaml"))
        return
    record = import_record(tmp_path / "run.csv", load_map(tmp_path / "map.yaml"))
    assert np.allclose(record["position"].y[0], -math.pi / 2)


def test_blocks_make_no_difference(files, monkeypatch):
    text = LONG.replace("0.50,50,50,50\n", "0.50,50,50\n").replace("0.07,7,", "0.07,,")
    whole = files(MAP, text)
    monkeypatch.setattr("msg_adapters.tables.text_file.BLOCK", 37)
    parts = files(MAP, text)
    assert parts.faults == whole.faults
    assert all(np.array_equal(parts[name].y, whole[name].y) for name in whole.channels)


MEANINGS = {
    "command": "commanded motor torque at the gear output; it takes effect at its stamp",
    "motor_torque": "motor torque from the measured current, at the gear output",
    "ft": "F/T sensor about the joint's axis, positive when the spring pushes the distal side forward",
    "deflection": "angle of the spring from its own encoder, with the sign of `ft`",
    "position": "angle of the gear output relative to the housing",
    "velocity": "rate of `position`",
    "reference": "target position of a controller that was active during the record",
    "reference_velocity": "target velocity of a MIT frame",
}
SECTIONS = {
    "map": import_map.MAP, "time": import_map.TIME, "where": import_map.WHERE, "runs": import_map.RUNS,
    "channels": [replace(key, meaning=MEANINGS[key.name]) for key in import_map.CHANNEL],
    "channels.NAME": import_map.TERM,
}  # fmt: skip


def tables():
    """Return the tables of docs/import.md in Markdown: all keys, all units, the functions of expressions."""
    rows = [f"| {name} | {', '.join(f'`{unit}`' for unit in factors)} |" for name, factors in FACTORS.items()]
    units = "\n".join(["| dimension | units |", "|---|---|", *rows])
    calls = [f"| `{name}({', '.join('xyz'[:n])})` | {says} |" for name, (_, n, says) in FUNCTIONS.items()]
    functions = "\n".join(["| function | is |", "|---|---|", *calls])
    sections = (table(section, keys) for section, keys in SECTIONS.items())
    return "\n".join([*sections, units, "", functions]) + "\n"


def test_docs_show_every_key():
    """To mend it: write what `tables()` returns behind the mark in docs/import.md."""
    page = (Path(__file__).parents[3] / "docs" / "import.md").read_text(encoding="utf-8")
    assert page.partition("<!-- tables -->\n")[2] == tables()


def test_of_a_value_that_the_log_repeats_the_first_row_is_kept(files):
    """A controller's log at 1 kHz repeated each reading for 15 ms, and each row counted as one."""
    held = "channels: {position: {column: phi, unit: rad, held: true}, command: {column: load, unit: N m}}"
    csv = "t;phi;load\n0;1;1\n1;1;2\n2;1;3\n3;2;4\n4;2;5\n5;4;6\n"
    record = files("time: {column: t, unit: s}\n" + held, csv)
    assert record["position"].t.tolist() == [0.0, 3.0, 5.0]
    assert record["position"].y.tolist() == [1.0, 2.0, 4.0]
    assert len(record["command"]) == 6
    with pytest.raises(ImportMapError, match="held at 1, expected values that change"):
        files("time: {column: t, unit: s}\n" + held, "t;phi;load\n0;1;1\n1;1;2\n2;1;3\n")
    with pytest.raises(ImportMapError, match="held is 'yes', expected true or false"):
        files("time: {column: t, unit: s}\n" + held.replace("true", "'yes'"), csv)


MAPS = Path(__file__).resolve().parents[3] / "config" / "imports"
BAD_MAPS = {
    "{": "not YAML",
    "time: {rate: 1}\nchannels: {current: {column: i, unit: A}}": "no 'current': map it as `command`",
    "time: {rate: 1}\nchannels: {}": "channels is empty, expected some of command",
    f"where: {{column: t}}\n{MAP}": "where: expected one of from, below, equals",
    f"\ndelimiter: ''{MAP}": "line 2: delimiter is '', expected one of ','",
    f'\ndelimiter: "\\n"{MAP}': "line 2: delimiter is '.*', expected one of ','",
    f"\nwhere: {{column: yes, from: 1}}{MAP}": "line 2: where.column is True, expected a name",
    f"\nwhere: {{column: load, from: .nan}}{MAP}": "line 2: where.from is nan, expected a number",
    f"\nwhere: {{column: load, from: 1:30}}{MAP}": "line 2: where.from: '1:30' is sexagesimal",
    f"\nabout: x\nabout: y{MAP}": "line 3: key 'about' stands twice, first in line 2",
}
CLOCK = "time: {column: t, unit: s}"
BAD_TERMS = [
    ("deg", "degrees", "unit 'degrees' unknown, expected one of s, ms"),
    ("sign: -1", "sign: 2", "channels.position.sign is 2.0, expected 1 or -1"),
    (", scale: 6.8", "", r"channels.command\[0\]: unit 'mA' is a current, expected a torque, or a scale"),
    ("position", "angle", "channels: unknown key 'angle', expected command"),
    ("unit: deg", "unit: mm", "channels mix 'mm' and 'N m', expected a linear or a rotary machine"),
    ("unit: s", "unit: rad", "time: unit 'rad' is a angle, expected a time"),
    (CLOCK, "time: {rate: 0}", "time.rate is 0.0, expected more than 0 Hz"),
    (CLOCK, "time: {rate: 1e-300}", "line 2: time.rate is 1e-300, expected more than 0 Hz: 0.001 to"),
    (CLOCK, "time: {}", "expected either a column with its unit, or a rate"),
    ("scale: 6.8", "scale: .nan", r"line 5: channels.command\[0\].scale is nan, expected a number"),
    ("scale: 6.8", "scale: 0", r"line 5: channels.command\[0\].scale is 0, expected another number"),
    ("column: phi", "column: [phi]", r"line 4: channels.position.column is \['phi'\], expected a name"),
    ("position: {", "position: [] #{", "line 4: channels.position is an empty list, expected a column"),
    ("unit: deg", "unit: N m", "line 4: channels.position: unit 'N m' is a torque, expected a angle"),
]
"""Of MAP: what stands there, what is put in its place."""


@pytest.mark.parametrize(
    ("text", "message"),
    [*BAD_MAPS.items(), *((MAP.replace(old, new), message) for old, new, message in BAD_TERMS)],
)
def test_senseless_maps_are_refused(files, tmp_path, text, message):
    with pytest.raises(ImportMapError, match=message) as caught:
        files(text)
    assert str(caught.value).startswith(str(tmp_path / "map.yaml"))
    assert "\n" not in str(caught.value)


BAD_FILES = {
    "": "empty file, expected a row of column names and rows of numbers",
    "t,phi,i,load\n": "no rows, expected numbers below the column names",
    CSV.replace("phi", "psi"): "no column 'phi', expected one of t, psi, i, load",
    CSV.replace("-45", "lots"): "line 3, column 'phi' is 'lots', expected a finite number",
    CSV.replace(",", ";").replace("-45", "-4,5"): "line 3, column 'phi' is '-4,5', .*, with a decimal point",
    CSV.replace(",6\n", "\n"): "line 4 has 3 fields, expected 4, as in 1 of 3 rows",
    CSV.replace("t,phi,i", "t,phi,phi"): r"column 'phi' stands 2 times \(2, 3\), expected once",
    CSV.split("0.5")[0]: "fewer than two rows, expected a record",
    CSV.replace("1.0,", "1e300,"): "stamps from 0 s to 1e[+]300 s, expected less than .*another unit of time",
    "x" * 2_000_000: "a line of more than 1048576 characters",
    "\0" + CSV: "not a text",
    CSV + CSV.partition("\n")[2] * 9: r"t of row 4 goes back \(0.000000 s after 1.000000 s\), expected one",
    CSV.replace("0.5,", "0.0,").replace("1.0,", "0.0,"): "t is 0 s in every row, expected a clock that runs",
}


@pytest.mark.parametrize("text", BAD_FILES)
def test_files_that_do_not_fit_the_map_are_refused(files, tmp_path, text):
    with pytest.raises(ImportMapError, match=BAD_FILES[text]) as caught:
        files(MAP, text)
    assert str(caught.value).startswith(str(tmp_path / "run.csv"))


def test_a_value_too_large_for_its_unit_is_refused(files):
    with pytest.raises(ImportMapError, match=r"command: i [+] load is too large for its unit"):
        files(MAP.replace("6.8", "1e250"), CSV.replace("1500", "1e200"))


def test_a_folder_and_a_pipe_are_refused(files, tmp_path):
    files()
    mapping = load_map(tmp_path / "map.yaml")
    (tmp_path / "folder.csv").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    for name, message in (("folder.csv", "is a directory, expected a file"), ("pipe.csv", "is a pipe")):
        with pytest.raises(ImportMapError, match=f"{name}: {message}"):
            import_record(tmp_path / name, mapping)


def test_a_table_with_too_many_numbers_is_refused(files, monkeypatch):
    monkeypatch.setattr("msg_adapters.tables.column_table.LARGEST", 300)
    with pytest.raises(ImportMapError, match=r"more than 75 rows of 4 columns, expected a shorter record"):
        files(MAP, CSV + "1.5,0,0,6\n" * 97)


@pytest.mark.parametrize(
    ("map_file", "text"),
    [
        ("lerobot", "position: no unit, expected `unit: rad`, or mrad, deg, arcmin or rev in its place, or"),
        ("joint_states_echo", "time: no unit, expected `unit: s`, or ms, us, ns or min in its place; the"),
    ],
)
def test_a_missing_unit_says_what_to_type(map_file, text, tmp_path):
    """A LeRobot file holds degrees or per cent of the travel, and does not say which."""
    part = "position" if map_file == "lerobot" else "time"
    lines = (MAPS / f"{map_file}.yaml").read_text(encoding="utf-8").splitlines()
    cut = [re.sub(r", unit: [^,}]+", "", line) if line.strip().startswith(part) else line for line in lines]
    (tmp_path / "map.yaml").write_text("\n".join(cut), encoding="utf-8")
    with pytest.raises(ImportMapError) as error:
        load_map(tmp_path / "map.yaml")
    assert text in str(error.value)
