"""A first map of a text table: it imports as it stands, and asks for what the file does not say."""

import re

import numpy as np
import pytest
from scipy.signal import detrend

from msg_adapters.tables import guess_map, import_record, load_map
from msg_adapters.tables.guess import _without_line
from rsea_ros.errors import ImportMapError

T = np.arange(400) * 0.004
ANGLE, TORQUE = 0.3 * np.sin(9.0 * T), 2.0 * np.cos(9.0 * T)
RATE = 2.7 * np.cos(9.0 * T)


def table(path, *columns, comma=","):
    """Write columns of (name, values) as text."""
    rows = zip(*(values for _, values in columns), strict=True)
    cells = lambda row: comma.join(v if isinstance(v, str) else f"{v:.9g}" for v in row)  # noqa: E731
    path.write_text("\n".join([comma.join(name for name, _ in columns), *map(cells, rows)]) + "\n")
    return path


def imported(path):
    """Return the record by the guessed map, and the map."""
    text = guess_map(path)
    (path.parent / "map.yaml").write_text(text)
    return import_record(path, load_map(path.parent / "map.yaml")), text


def test_names_and_units_of_the_columns_make_the_record(tmp_path):
    columns = (
        ("Time [ms]", 1e3 * T), ("goal_torque_Nm", TORQUE), ("jointPosition (deg)", np.degrees(ANGLE)),
        ("vel_rpm", RATE * 30.0 / np.pi), ("Fz", 3.0 * TORQUE), ("error", 0.01 * TORQUE),
    )  # fmt: skip
    record, text = imported(table(tmp_path / "run.csv", *columns))
    assert set(record.channels) == {"command", "position", "velocity", "ft"}
    for name, true in (("command", TORQUE), ("position", ANGLE), ("velocity", RATE), ("ft", 3.0 * TORQUE)):
        assert record[name].y == pytest.approx(true, abs=1e-6)
    assert record["position"].rate == pytest.approx(250.0)
    assert text.count("? unit") == 1 and "# not used: error" in text


def test_the_step_tells_the_unit_of_the_stamps_and_the_position_that_of_its_rate(tmp_path):
    columns = (("stamp", 1e6 * T), ("q", ANGLE), ("dq", np.degrees(RATE)), ("tau", TORQUE), ("iq", TORQUE))
    record, text = imported(table(tmp_path / "run.csv", *columns))
    assert record["velocity"].y == pytest.approx(RATE, rel=1e-3, abs=1e-3)
    assert record["position"].rate == pytest.approx(250.0)
    assert "motor_torque: {column: iq, unit: A" in text and "ft: {column: tau" in text
    assert "# command: ?" in text


@pytest.mark.parametrize(
    ("column", "channel"),
    [
        ("u", "command"), ("cmdTorque", "command"), ("tau_des", "command"), ("goal_current", "command"),
        ("q_des", "reference"), ("TargetPosition", "reference"), ("desired_angle", "reference"),
        ("joint_torque", "motor_torque"), ("iq", "motor_torque"), ("present_load", "motor_torque"),
        ("Fz", "ft"), ("tz", "ft"), ("load_cell", "ft"), ("output_torque", "ft"), ("SensorForce", "ft"),
        ("output_angle", "position"), ("q1", "position"), ("encoder_ticks", "position"),
        ("spring_deflection", "deflection"), ("omega", "velocity"), ("no", ""), ("integrated", ""),
    ],
)  # fmt: skip
def test_names_of_columns(tmp_path, column, channel):
    text = guess_map(table(tmp_path / "run.csv", ("t", T), (column, TORQUE + 0.3 * T)))
    found = re.findall(r"^  (\w+): [{]column: (\w+)", text, re.MULTILINE)
    assert found == ([(channel, column)] if channel else [])


def test_a_velocity_that_is_no_rate_in_any_unit_is_asked_for(tmp_path):
    _, text = imported(table(tmp_path / "run.csv", ("t", T), ("q", ANGLE), ("w", 3.7 * RATE), ("u", TORQUE)))
    assert re.search("the rate of q; [?] 3.7[0-9]? times too large for that", text)


@pytest.mark.parametrize(("comma", "text"), [(";", "decimal: \",\""), (",", "")])
def test_units_in_a_row_decimal_commas_texts_and_codes(tmp_path, comma, text):
    codes = np.round(400.0 * np.sin(9.0 * T)) % 65536
    rows = [["t", "phase", "u", "q"], ["ms", "-", "mNm", "deg"]]
    rows += [[f"{1e3 * a:.3f}", "a" if a < 1.0 else "b", f"{b:.0f}", f"{c:.6f}"]
             for a, b, c in zip(T, codes, np.degrees(ANGLE), strict=True)]  # fmt: skip
    file = tmp_path / "run.csv"
    written = "\n".join(comma.join(row) for row in rows)
    file.write_text(written.replace(".", ",") if comma == ";" else written)
    guessed = guess_map(file)
    assert text in guessed and "unit: deg" in guessed and "unit: mN m" in guessed
    assert "phase holds texts, a, b" in guessed and "int16(u)" in guessed


def test_names_of_columns_and_texts_stay_names(tmp_path):
    texts = ["\x85command: 1"] * len(T)
    columns = (("t", T), ("cmd: [x]\x85evil: 1", TORQUE), ('q "a"', ANGLE), ("p", texts))
    names = ('"' + name.replace('"', '""') + '"' for name, _ in columns)
    path = table(tmp_path / "run.csv", *((name, y) for name, (_, y) in zip(names, columns, strict=True)))
    record, _ = imported(path)
    assert record["command"].y == pytest.approx(TORQUE, abs=1e-6) and "position" in record


def test_a_text_that_is_no_table_is_one_line(tmp_path):
    (tmp_path / "run.csv").write_text("hello\nworld\n")
    with pytest.raises(ImportMapError, match="expected a table with two columns"):
        guess_map(tmp_path / "run.csv")


@pytest.mark.parametrize("n", [2, 3, 400])
def test_a_column_without_its_line_is_that_of_scipy_to_the_last_bit(n):
    y = 7.0 + np.cumsum(np.random.default_rng(n).standard_normal(n))
    assert np.array_equal(_without_line(y), detrend(y))
