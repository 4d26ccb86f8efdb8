"""Senseless import maps and files that do not fit are refused by file, line, field and value."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from map_files import CSV, MAP

from msg_adapters.tables import import_record, load_map
from rsea_ros.errors import ImportMapError

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
    CSV.replace("1.0,", "0.2,"): r"t of row 3 goes back \(0.200000 s after 0.500000 s\)",
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
