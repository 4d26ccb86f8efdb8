"""Import maps: units and signs by numbers worked out by hand, and every nonsense refused by name."""

from __future__ import annotations

import math

import numpy as np
import pytest

from msg_adapters.tables import import_record, load_map
from rsea_ros.errors import ImportMapError

CSV = "t,phi,i,load\n0.0,90,1500,2\n0.5,-45,-500,4\n1.0,0,0,6\n"
MAP = """
time: {column: t, unit: s}
channels:
  position: {column: phi, unit: deg, sign: -1}
  command: [{column: i, unit: mA, scale: 6.8}, {column: load, unit: N m, constant: 0.5}]
"""


@pytest.fixture
def files(tmp_path):
    """Return a function that writes a map and a CSV file and imports them."""

    def run(map_text=MAP, csv_text=CSV, name="run.csv"):
        (tmp_path / "map.yaml").write_text(map_text)
        (tmp_path / name).write_text(csv_text)
        return import_record(tmp_path / name, load_map(tmp_path / "map.yaml"))

    return run


def test_units_signs_scales_and_sums(files):
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
def test_units_of_a_position(files, unit, value):
    text = f"time: {{rate: 100}}\nchannels: {{position: {{column: phi, unit: {unit}}}}}"
    record = files(text)
    assert np.allclose(record["position"].y, np.array([90, -45, 0]) * value)
    assert np.allclose(record["position"].t, [0.0, 0.01, 0.02])


@pytest.mark.parametrize(("unit", "value"), [("rpm", math.pi / 30), ("deg/s", math.pi / 180), ("m/s", 1.0)])
def test_units_of_a_velocity(files, unit, value):
    record = files(f"time: {{column: t, unit: min}}\nchannels: {{velocity: {{column: phi, unit: {unit}}}}}")
    assert np.allclose(record["velocity"].y, np.array([90, -45, 0]) * value)
    assert record["velocity"].t.tolist() == [0.0, 30.0, 60.0]


@pytest.mark.parametrize(
    ("where", "kept"),
    [
        ("below: 5", [2.0, 4.0]),
        ("from: 4", [4.0, 6.0]),
        ("from: 3, below: 7", [4.0, 6.0]),
        ("equals: 0", [4.0, 6.0]),
    ],
)
def test_rows_that_count(files, where, kept):
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


def test_separators_comments_and_missing_names(files):
    assert np.allclose(files(MAP, CSV.replace(",", "\t"), "run.tsv")["position"].y[0], -math.pi / 2)
    assert np.allclose(files(f'delimiter: ";"\n{MAP}', CSV.replace(",", ";"))["position"].y[0], -math.pi / 2)
    assert np.allclose(files(MAP, f"# a comment\n{CSV}\n")["position"].y[0], -math.pi / 2)
    numbered = (
        MAP.replace("column: t", "column: 1").replace("phi", "2").replace("i,", "3,").replace("load", "4")
    )
    assert np.allclose(files(numbered, CSV.partition("\n")[2])["position"].y[0], -math.pi / 2)


def test_a_dated_clock_keeps_its_date(files):
    csv = CSV.replace("\n0.", "\n1763000000.").replace("\n1.0", "\n1763000001.0")
    assert files(MAP, csv).epoch_ns == 1_763_000_000_000_000_000


BAD_MAPS = {
    "{": "not YAML",
    "channels: {}": "map: no 'time', expected channels, time",
    "[]": r"map is \[\], expected a mapping with",
    MAP.replace("deg", "degrees"): "unit 'degrees' unknown, expected one of s, ms",
    MAP.replace("sign: -1", "sign: 2"): r"channels.position.sign is 2.0, expected 1 or -1",
    MAP.replace(
        ", scale: 6.8", ""
    ): r"channels.command\[0\]: unit 'mA' is a current, expected a torque, or a scale",
    MAP.replace("scale: 6.8", "scale: lots"): "scale is 'lots', expected a number",
    MAP.replace("position", "angle"): "channels: unknown key 'angle', expected command",
    MAP.replace("sign: -1", "signe: -1"): "channels.position: unknown key 'signe', expected column",
    MAP.replace(
        "unit: deg", "unit: mm"
    ): "channels mix 'mm' and 'N m', expected a linear or a rotary machine",
    MAP.replace("unit: s", "unit: rad"): "time: unit 'rad' is a angle, expected a time",
    MAP.replace(
        "time: {column: t, unit: s}", "time: {rate: 0}"
    ): r"time.rate is 0.0, expected more than 0 Hz",
    MAP.replace(
        "time: {column: t, unit: s}", "time: {}"
    ): "expected either a column with its unit, or a rate",
    f"where: {{column: t}}\n{MAP}": "where: expected one of from, below, equals",
    "time: {rate: 1}\nchannels: {}": "channels is empty, expected some of command",
}


@pytest.mark.parametrize("text", BAD_MAPS)
def test_maps_that_make_no_sense(files, tmp_path, text):
    with pytest.raises(ImportMapError, match=BAD_MAPS[text]) as caught:
        files(text)
    assert str(caught.value).startswith(str(tmp_path / "map.yaml"))
    assert "\n" not in str(caught.value)


BAD_FILES = {
    "": "empty file, expected a row of column names and rows of numbers",
    "t,phi,i,load\n": "no rows, expected numbers below the column names",
    CSV.replace("phi", "psi"): "no column 'phi', expected one of t, psi, i, load",
    CSV.replace("-45", "n/a"): "line 3, column 'phi' is 'n/a', expected a finite number",
    CSV.replace("-45", "nan"): "line 3, column 'phi' is 'nan', expected a finite number",
    CSV.replace("-45", ""): "line 3, column 'phi' is '', expected a finite number",
    CSV.replace(",6\n", "\n"): "line 4, column 'load' is 'missing', expected a finite number",
    CSV.replace("1.0,", "0.2,"): r"t of row 3 goes back \(0.200000 s after 0.500000 s\)",
    CSV.replace("0.5,", "0.0,").replace("1.0,", "0.0,"): "t is 0 s in every row, expected a clock that runs",
}


@pytest.mark.parametrize("text", BAD_FILES)
def test_files_that_do_not_fit(files, tmp_path, text):
    with pytest.raises(ImportMapError, match=BAD_FILES[text]) as caught:
        files(MAP, text)
    assert str(caught.value).startswith(str(tmp_path / "run.csv"))


def test_no_row_left(files):
    with pytest.raises(ImportMapError, match=r"fewer than two rows left by where \(load goes from 2 to 6\)"):
        files(f"where: {{column: load, below: 1}}\n{MAP}")
