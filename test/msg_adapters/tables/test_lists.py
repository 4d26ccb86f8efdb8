"""Tables whose cells hold a list for several joints, and machines that log several files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from msg_adapters.tables import import_record, load_map
from rsea_ros.errors import ImportMapError

MAPS = Path(__file__).resolve().parents[3] / "config" / "imports"
ROWS = [f'C,{20000 * k},"[{k}.0, {-k - 1}.5, 7]"\n' for k in range(40)]
TARGETS = "type,timestamp,positions\n" + "".join(ROWS)
STATES = "type,timestamp,positions,torques\n" + "".join(
    f'S,{20000 * k + 500},"[{k}.25,{k}.75, 1e-3]","[1, 2, 3]"\n' for k in range(40)
)


@pytest.fixture
def motion(tmp_path):
    place = tmp_path / "motion"
    place.mkdir()
    (place / "control.csv").write_text(TARGETS)
    (place / "state_motor.csv").write_text(STATES)
    return place


def test_a_joint_is_read_from_two_files(motion):
    record = import_record(motion, load_map(MAPS / "so101.yaml"), 1)
    assert set(record.channels) == {"reference", "position"}
    assert np.allclose(record["reference"].y, -np.arange(40) - 1.5)
    assert np.allclose(record["position"].y, np.arange(40) + 0.75)
    assert np.allclose(record["position"].t - record["reference"].t, 5e-4)  # each file has its stamps


@pytest.mark.parametrize(
    ("index", "words"),
    [
        (
            None,
            r"column 'positions\[#\]' holds several joints, expected .* of one, from 0 \(--index\)",
        ),
        (3, r"control.csv: line 2, column 'positions\[3\]' .* a list of 3 numbers, expected more than 3"),
    ],
)
def test_a_missing_joint_is_named(motion, index, words):
    with pytest.raises(ImportMapError, match=words):
        import_record(motion, load_map(MAPS / "so101.yaml"), index)


PER_JOINT = """time: {rate: 100}
channels:
  position: {column: "q[#]", unit: deg, sign: [1, -1, 1], scale: 2, constant: [0, 0.5, 1]}
"""


@pytest.fixture
def joints(tmp_path):
    np.savez(tmp_path / "run.npz", q=np.arange(30.0).reshape(10, 3))

    def made(text):
        (tmp_path / "map.yaml").write_text(text)
        return tmp_path / "run.npz", load_map(tmp_path / "map.yaml")

    return made


@pytest.mark.parametrize(("index", "sign", "constant"), [(0, 1.0, 0.0), (1, -1.0, 0.5), (2, 1.0, 1.0)])
def test_a_map_may_have_a_sign_and_a_constant_for_each_joint(joints, index, sign, constant):
    record = import_record(*joints(PER_JOINT), index)
    q = np.arange(30.0).reshape(10, 3)[:, index]
    assert np.allclose(record["position"].y, 2.0 * sign * np.deg2rad(q) + constant)


@pytest.mark.parametrize("index", [None, 3])
def test_values_for_each_joint_need_one_of_the_joints(joints, index):
    text = PER_JOINT.replace('"q[#]"', '"q[0]"')
    with pytest.raises(ImportMapError, match=r"position has a sign, .* joints 0, 1 and 2, .* --index"):
        import_record(*joints(text), index)


@pytest.mark.parametrize(
    ("was", "put", "words"),
    [
        ("[1, -1, 1]", "[1, -1]", r"sign has numbers for .* 0 and 1, expected the joints 0, 1 and 2"),
        ("[1, -1, 1]", "[1, 2, 1]", r"sign is 2\.0, expected 1 or -1"),
        ("scale: 2", "scale: {}", "scale is an empty mapping, expected a number for each joint"),
        ("scale: 2", "scale: {left: 1}", "scale has the joint 'left', expected its number"),
    ],
)
def test_wrong_values_for_joints_are_refused(joints, was, put, words):
    with pytest.raises(ImportMapError, match=words):
        joints(PER_JOINT.replace(was, put))


STRANGE = "Zeit [ms];J1 Iq(A);J1 phi [°];J2 Iq(A);J2 phi [°];Pumpe #1\n" + "".join(
    f"{2 * k},0;{k},5;{k}; -{k},25;{3 * k};1\n" for k in range(20)
)
NUMBERED = """time: {column: "Zeit [ms]", unit: ms}
decimal: ","
channels:
  command: {column: "J# Iq(A)", unit: A, scale: {1: 4, 2: 3}}
  position: {column: "J# phi [°]", unit: rad, sign: {1: 1, 2: -1}}
"""


@pytest.fixture
def bench(tmp_path):
    """Return a function that gives the path of a log with two numbered joints, and a map."""
    (tmp_path / "bench.csv").write_text(STRANGE, encoding="latin-1")

    def made(text):
        (tmp_path / "map.yaml").write_text(text, encoding="utf-8")
        return tmp_path / "bench.csv", load_map(tmp_path / "map.yaml")

    return made


def test_the_number_of_a_joint_may_stand_anywhere_in_a_name(bench):
    k = np.arange(20.0)
    first, second = (import_record(*bench(NUMBERED), index) for index in (1, 2))
    assert np.allclose(first["command"].y, 4.0 * (k + 0.5))
    assert np.allclose(second["command"].y, -3.0 * (k + 0.25))
    assert np.allclose(second["position"].y, -3.0 * k)


def test_a_map_names_only_files_of_the_directory(tmp_path):
    text = (MAPS / "so101.yaml").read_text()
    (tmp_path / "map.yaml").write_text(text.replace("file: control.csv", "file: ../control.csv"))
    with pytest.raises(ImportMapError, match="expected the name of a file in the directory"):
        load_map(tmp_path / "map.yaml")
