"""YAML that people write: ambiguous text is refused with its line, and nothing expands while it is read."""

import os
import time

import pytest
from hypothesis import given, settings, strategies as st

from rsea_ros.documents.strict_yaml import DEEPEST, LARGEST, dump, parse, read
from rsea_ros.errors import FieldError

REFUSED = {
    "a: 1\nb: 2\na: 3": r"line 3: key 'a' stands twice, first in line 1",
    "g:\n  value: 0x10": r"line 2: g.value: '0x10' is hexadecimal, expected a decimal number",
    "a: 010": r"line 1: a: '010' is octal",
    "a: 0b11": r"line 1: a: '0b11' is binary",
    "a: 1:30": r"line 1: a: '1:30' is sexagesimal",
    "a: 1_000": r"line 1: a: '1_000' is a number with underscores",
    "a: [1, 2024-07-18]": r"line 1: a.1: '2024-07-18' is a date",
    "a: &x 1": r"line 1: an anchor or alias",
    "a: !!binary aGk=": r"not YAML: line 1: tag 'tag:yaml.org,2002:binary', expected none",
    "? [1]\n: 2": r"line 1: a key that is not a single word",
    "a: 1\n---\nb: 2": r"not YAML: a second document",
    "a: [": r"not YAML: ",
    "a: " + "[" * 50_000: rf"line 1: nested more than {DEEPEST} deep",
    "\n".join("  " * level + "a:" for level in range(50)): r"line 17: nested more than 16 deep",
}


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: text[:30])
def test_ambiguous_yaml_is_refused(text):
    with pytest.raises(FieldError, match=rf"^{REFUSED[text]}") as caught:
        parse(text)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 250


def test_a_bomb_of_aliases_is_refused_at_once():
    layers = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    layers += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 10)]
    started = time.process_time()
    with pytest.raises(FieldError, match=r"line 1: an anchor"):
        parse("\n".join(layers))
    assert time.process_time() - started < 1.0


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("12", 12),
        ("1e-3", 1e-3),
        ("5.0e-6", 5e-6),
        (".5", 0.5),
        ("yes", True),
        ("False", False),
        ("~", None),
        ("", None),
        (".inf", float("inf")),
        ("'0x10'", "0x10"),
        ("nan", "nan"),
        ("1e999", "1e999"),
        ("N m/rad", "N m/rad"),
        ("1" * 5000, "1" * 5000),
    ],
)
def test_a_value_is_what_a_person_means(text, value):
    assert parse(f"a: {text}").content == {"a": value}


PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**9), 10**9)
    | st.floats(allow_nan=False)
    | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=20,
)


@settings(max_examples=20, deadline=None)
@given(st.dictionaries(st.text(max_size=8), PLAIN, max_size=4))
def test_files_that_the_project_writes_are_read_back(document):
    assert parse(dump(document)).content == document


def test_a_field_is_located_by_its_line():
    document = parse(
        "name: x\nrotor:\n  inertia:\n    unit: kg\n    value: 3\neffects:\n- name: a\n- name: b\n"
    )
    assert document.where("rotor.inertia") == "line 5: "
    assert document.where("rotor.inertia.unit") == "line 4: "
    assert document.where("rotor.damping") == "line 2: "
    assert document.where("effects[1].name") == "line 8: "
    assert document.where("rig.name") == "line 1: "
    assert document.where("") == ""


def test_a_file_must_be_utf_8_text_of_bounded_size(tmp_path):
    file = tmp_path / "a.yaml"
    file.write_bytes(b"\xef\xbb\xbfa: 1\r\n")
    assert read(file).content == {"a": 1}
    file.write_bytes(b"a: \xff")
    with pytest.raises(FieldError, match=r"not YAML: .*, expected text in UTF-8"):
        read(file)
    file.write_bytes(b"a: " + b"x" * LARGEST)
    with pytest.raises(FieldError, match="more than 1048576 bytes"):
        read(file)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FieldError, match="is a pipe, expected a file"):
        read(tmp_path / "pipe")
