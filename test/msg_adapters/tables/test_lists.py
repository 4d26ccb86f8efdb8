"""Tables whose cells hold a list for several joints, and machines that log several files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from msg_adapters.tables import import_record, load_map
from rsea_ros.cli.main import main
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


def test_a_cell_that_is_not_a_list_is_refused(motion):
    (motion / "control.csv").write_text(TARGETS.replace('"[3.0, -4.5, 7]"', "3.0"))
    with pytest.raises(ImportMapError, match=r"line 5, .* expected a list of numbers in brackets"):
        import_record(motion, load_map(MAPS / "so101.yaml"), 0)


def test_a_file_in_place_of_a_directory_is_refused(motion):
    with pytest.raises(ImportMapError, match=r"expected the one that holds control\.csv, state_motor\.csv"):
        import_record(motion / "control.csv", load_map(MAPS / "so101.yaml"), 0)


def test_a_map_names_only_files_of_the_directory(tmp_path):
    text = (MAPS / "so101.yaml").read_text()
    (tmp_path / "map.yaml").write_text(text.replace("file: control.csv", "file: ../control.csv"))
    with pytest.raises(ImportMapError, match="expected the name of a file in the directory"):
        load_map(tmp_path / "map.yaml")


def test_the_verb_imports_lists(motion, tmp_path, capsys):
    out = str(tmp_path / "joint.mcap")
    assert main(["import", str(motion), "--map", "so101", "--index", "0", "--out", out]) == 0
    assert "positions[0] [rad]" in capsys.readouterr().out
