"""Texts as other programs write them: preambles, units below the names, decimal commas, D exponents."""

from __future__ import annotations

import numpy as np
import pytest

from msg_adapters.tables import import_record, load_map
from rsea_ros.errors import ImportMapError

MAP = """time: {column: t, unit: s}
channels:
  command: {column: u, unit: N m}
"""
STAMPS, VALUES = [0.0, 0.1, 0.2], [1.5, -2.5, 1500.0]

TEXTS = {
    "units below the names": ("t,u,note\ns,N m,-\n0,1.5,a\n0.1,-2.5,b\n0.2,1500,c\n", ""),
    "units in brackets": ("t;u\n[s];[Nm]\n0;1.5\n0.1;-2.5\n0.2;1500\n", ""),
    "preamble": ("Bench 3\nDate: 12.3.2024, 14:05\n\nt,u\n0,1.5\n0.1,-2.5\n0.2,1500\n", ""),
    "preamble and units": ("a;b;c;d\n1;2\nt;u\ns;Nm\n0;1.5\n0.1;-2.5\n0.2;1500\n", ""),
    "decimal commas": ("t;u\n0,0;1,5\n0,1;-2,5\n0,2;1,5e3\n", 'decimal: ","\n'),
    "decimal commas in quotes, no delimiter in the map": (
        't,u\n"0,0","1,5"\n"0,1","-2,5"\n"0,2","1,5e3"\n',
        'decimal: ","\n',
    ),
    "decimal commas in quotes": (
        't,u\n"0,0","1,5"\n"0,1","-2,5"\n"0,2","1500"\n',
        'decimal: ","\ndelimiter: ","\n',
    ),
    "date-times": (
        "t,u\n2025-11-12T10:03:29Z,1.5\n2025-11-12T10:03:29.100000Z,-2.5\n2025-11-12 11:03:29.2+01:00,1500\n",
        "",
    ),
    "names in a comment": ("% bench 3\n# t u\n 0.0 1.5\n 0.1 -2.5\n 0.2 1500\n", ""),
    "names in a comment with other separators": ("# t, u\n0.0;1.5\n0.1;-2.5\n0.2;1500\n", ""),
    "a last column without a name": ("t,u,\n0,1.5,7\n0.1,-2.5,8\n0.2,1500,9\n", ""),
    "a delimiter at the end of each line": ("t,u,\n0,1.5,\n0.1,-2.5,\n0.2,1500,\n", ""),
    "D exponents": ("t u\n 0.0D+00 1.5D0\n 1.0D-01 -2.5d+00\n 2.0D-1 0.15D+04\n", ""),
}


def import_file(folder, text, more=""):
    (folder / "run.csv").write_text(text)
    (folder / "map.yaml").write_text(MAP + more)
    return import_record(folder / "run.csv", load_map(folder / "map.yaml"))


@pytest.mark.parametrize("name", TEXTS)
def test_it_is_read(name, tmp_path):
    command = import_file(tmp_path, *TEXTS[name])["command"]
    np.testing.assert_allclose(command.t, STAMPS, atol=1e-12 if "date" not in name else 3e-7)
    np.testing.assert_allclose(command.y, VALUES)


@pytest.mark.parametrize("decimal", ["", 'decimal: ","\n'])
@pytest.mark.parametrize("sign", [".", ","])
def test_a_table_without_names_is_read_or_refused_with_the_line_that_reads_it(decimal, sign, tmp_path):
    numbered = MAP.replace("column: t", "column: 1").replace("column: u", "column: 2")
    (tmp_path / "run.csv").write_text("0.0;1.5\n0.1;-2.5\n0.2;1500\n".replace(".", sign))
    (tmp_path / "map.yaml").write_text(numbered + decimal)
    if sign == "," and not decimal:
        with pytest.raises(ImportMapError, match='`decimal: ","` in the map'):
            import_record(tmp_path / "run.csv", load_map(tmp_path / "map.yaml"))
        return
    record = import_record(tmp_path / "run.csv", load_map(tmp_path / "map.yaml"))
    np.testing.assert_allclose(record["command"].y, VALUES)


def test_what_is_left_out_is_noted(tmp_path):
    notes = " ".join(import_file(tmp_path, *TEXTS["preamble and units"]).notes)
    assert "lines 1 to 2 above the names of the columns are left out" in notes
    assert "line 4 is taken for the units: s;Nm" in notes


@pytest.mark.parametrize("row", ["0x10,1.5", "12:30,s", "1.2.3,N m"])
def test_a_first_row_with_a_number_that_is_none_is_refused_as_before(row, tmp_path):
    with pytest.raises(ImportMapError, match="line 2, column 't' is"):
        import_file(tmp_path, f"t,u\n{row}\n0,1.5\n0.1,-2.5\n")


@pytest.mark.parametrize(
    ("text", "more", "message"),
    [
        ("t,u\n2025-13-12T10:03:29Z,1.5\n2025-13-12T10:03:30Z,2\n", "", "line 2, column 't' .*month must be"),
        ("t,u\n0,1.5,7\n0.1,-2.5,8\n", "", "has 3 fields, expected 2.*if a column has no name, number"),
    ],
)
def test_what_cannot_be_read_is_one_line(text, more, message, tmp_path):
    with pytest.raises(ImportMapError, match=message):
        import_file(tmp_path, text, more)


def test_date_times_have_no_other_unit_than_seconds(tmp_path):
    (tmp_path / "run.csv").write_text("t,u\n2025-11-12T10:03:29Z,1.5\n2025-11-12T10:03:30Z,-2.5\n")
    (tmp_path / "map.yaml").write_text(MAP.replace("unit: s", "unit: ms"))
    with pytest.raises(ImportMapError, match=r"time.unit is 'ms', and t holds date-times, expected s"):
        import_record(tmp_path / "run.csv", load_map(tmp_path / "map.yaml"))
