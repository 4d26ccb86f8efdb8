"""Texts as other programs write them: preambles, units below the names, decimal commas, D exponents."""

import numpy as np
import pytest

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


@pytest.mark.parametrize("name", TEXTS)
def test_it_is_read(name, files):
    text, more = TEXTS[name]
    command = files(MAP + more, text)["command"]
    np.testing.assert_allclose(command.t, STAMPS, atol=1e-12 if "date" not in name else 3e-7)
    np.testing.assert_allclose(command.y, VALUES)


@pytest.mark.parametrize("decimal", ["", 'decimal: ","\n'])
@pytest.mark.parametrize("sign", [".", ","])
def test_a_table_without_names_is_read_or_refused_with_the_line_that_reads_it(decimal, sign, files):
    numbered = MAP.replace("column: t", "column: 1").replace("column: u", "column: 2")
    text = "0.0;1.5\n0.1;-2.5\n0.2;1500\n".replace(".", sign)
    if sign == "," and not decimal:
        with pytest.raises(ImportMapError, match='`decimal: ","` in the map'):
            files(numbered, text)
        return
    np.testing.assert_allclose(files(numbered + decimal, text)["command"].y, VALUES)


def test_what_is_left_out_is_noted(files):
    notes = " ".join(files(MAP, TEXTS["preamble and units"][0]).notes)
    assert "lines 1 to 2 above the names of the columns are left out" in notes
    assert "line 4 is taken for the units: s;Nm" in notes


DATES = "t,u\n2025-{}-12T10:03:29Z,1.5\n2025-{}-12T10:03:30Z,2\n"


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        # a first row with a number that is none is no row of units
        ("t,u\n0x10,1.5\n0,1.5\n0.1,-2.5\n", "s", "line 2, column 't' is"),
        ("t,u\n12:30,s\n0,1.5\n0.1,-2.5\n", "s", "line 2, column 't' is"),
        ("t,u\n1.2.3,N m\n0,1.5\n0.1,-2.5\n", "s", "line 2, column 't' is"),
        (DATES.format(13, 13), "s", "line 2, column 't' .*month must be"),
        (DATES.format(11, 11), "ms", "time.unit is 'ms', and t holds date-times, expected s"),
        ("t,u\n0,1.5,7\n0.1,-2.5,8\n", "s", "has 3 fields, expected 2.*if a column has no name, number"),
    ],
)
def test_what_cannot_be_read_is_one_line(text, unit, message, files):
    with pytest.raises(ImportMapError, match=message):
        files(MAP.replace("unit: s", f"unit: {unit}"), text)
