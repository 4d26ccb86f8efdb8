"""Tables of several joints, files, runs and trials: chosen by number, name or text."""

import json
from pathlib import Path

import numpy as np
import pytest

from msg_adapters.tables import import_record, import_records, load_map
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
        (None, r"column 'positions\[#\]' holds several joints, expected .* of one, from 0 \(--index\)"),
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


CHANNELS = "channels:\n  command: {column: u, unit: N m}\n"
CSV = "t,phase,u\n0,rest,1\n1,chirp up/down,2\n2,chirp up/down,3\n3,rest,4\n4,,5\n"


def imported(folder, more, content=CSV, name="run.csv", time="{column: t, unit: s}", channels=CHANNELS):
    (folder / name).write_text(content)
    (folder / "map.yaml").write_text(f"time: {time}\n{more}\n{channels}")
    runs = import_records(folder / name, load_map(folder / "map.yaml"))
    return {one.name: one.record["command"].y.tolist() for one in runs}


def test_rows_are_chosen_by_a_text(tmp_path):
    assert imported(tmp_path, "where: {column: phase, equals: rest}") == {"": [1.0, 4.0]}


def test_runs_are_named_by_texts(tmp_path):
    runs = imported(tmp_path, "runs: {column: phase}")
    assert runs == {"-chirp_up_down": [2.0, 3.0], "-rest": [1.0, 4.0]}


def test_a_column_of_numbers_stays_one_whatever_another_row_lacks(tmp_path):
    content = "t,n,u\n0,1,1\n1,1.0,2\n2,2,3\n3,,4\n4,2,\n5,2,6\n"
    assert imported(tmp_path, "runs: {column: n}", content) == {"-run1": [1.0, 2.0], "-run2": [3.0, 6.0]}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("where: {column: phase, equals: Rest}", "left by where .phase is 'chirp up/down' or 'rest'"),
        ("where: {column: phase, below: 3}", "phase holds texts .*expected equals"),
        ("where: {column: t, equals: rest}", "where.equals is 'rest', expected a number .t goes from 0 to 4"),
    ],
)
def test_a_condition_that_does_not_go_with_the_column_names_what_is_there(more, message, tmp_path):
    with pytest.raises(ImportMapError, match=message):
        imported(tmp_path, more)


def trials(**more):
    up = [k / 10 for k in range(20)]
    return [{"type": "up", "i": up, **more}, {"type": "down", "i": [-one for one in up[::-1]], **more}]


def of_json(folder, document, more, time="{rate: 10}", column="data.i"):
    channels = f"channels:\n  command: {{column: {column}, unit: N m}}\n"
    return imported(folder, more, json.dumps(document), "run.json", time, channels)


@pytest.mark.parametrize(
    ("more", "names"),
    [
        ("runs: {column: data.type}", ["-down", "-up"]),
        ("runs: {column: data}", ["-run1", "-run2"]),
        ("where: {column: data.type, equals: up}", [""]),
        ("where: {column: data, equals: 2}", [""]),
    ],
)
def test_a_list_of_trials_is_read_trial_by_trial(more, names, tmp_path):
    runs = of_json(tmp_path, {"data": trials()}, more)
    assert list(runs) == names
    assert all(len(values) == 20 for values in runs.values())


@pytest.mark.parametrize(
    ("document", "more", "message"),
    [
        ({"data": trials()}, "", r"rows of 2 trials, .*runs: {column: data}"),
        ({"data": [*trials(), *trials()]}, "runs: {column: data.type}", "rows of 2 trials"),
        ({"data": trials(t=[0.0] * 19)}, "where: {column: data.t, below: 1}", "trial 1: data.i has 20"),
        ({"data": [{"i": [1, 2]}, {"i": [3, 4]}]}, "", r"expected a finite number: data.i\[0\]"),
    ],
)
def test_trials_are_never_joined(document, more, message, tmp_path):
    with pytest.raises(ImportMapError, match=message):
        of_json(tmp_path, document, more)
