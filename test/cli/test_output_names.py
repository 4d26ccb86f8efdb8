"""Names of outputs: never an input, a link or a device; a free one is chosen, and any text will do."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from writing_verbs import OLD, RIG, WRITERS, contents, prepare

import rsea_ros.outputs.files as files
from msg_adapters import read_record, write_record
from rsea_ros.cli.main import main
from rsea_ros.errors import OutputError


@pytest.fixture
def folder(record, tmp_path, monkeypatch) -> Path:
    """Return a working directory with inputs, in which verbs have their results without computing."""
    prepare(record, tmp_path, monkeypatch)
    return tmp_path


@pytest.mark.parametrize("verb", ["predict", "identify"])
def test_a_symbolic_link_is_not_followed(folder, refused, verb):
    words, names = WRITERS[verb]
    (folder / "out").mkdir()
    (folder / "precious").write_bytes(OLD)
    (folder / "out" / names[0]).symlink_to(folder / "precious")
    assert "exists already" in refused(*words)
    assert "is not a regular file, expected a new name" in refused(*words, "--force")
    assert (folder / "precious").read_bytes() == OLD
    assert [p.name for p in (folder / "out").iterdir()] == [names[0]]


@pytest.mark.parametrize("verb", ["predict", "simulate to a directory"])
def test_only_regular_files_are_replaced(folder, refused, verb):
    """A pipe stands for devices: replacing /dev/null would take a system down."""
    words, names = WRITERS[verb]
    (folder / "out").mkdir()
    os.mkfifo(folder / "out" / names[0])
    assert "is not a regular file, expected a new name" in refused(*words, "--force")
    assert (folder / "out" / names[0]).is_fifo()
    with pytest.raises(OutputError, match="is not a regular file"):
        files.give_names([(folder / "run.csv", folder / "out" / names[0])], force=True)


@pytest.mark.parametrize(
    "words",
    [
        ["predict", RIG, "run.mcap", "--out", "run.mcap"],
        ["predict", "rig.yaml", "run.mcap", "--out", "./rig.yaml"],
        ["predict", RIG, "bag", "--out", "bag/bag.mcap"],
        ["predict", RIG, "run.mcap", "--out", "other.mcap"],
        ["simulate", "rig.yaml", "--out", "rig.yaml"],
        ["export", "--mjcf", "rig.yaml", "--out", "rig.yaml"],
        ["import", "run.csv", "--map", "map.yaml", "--out", "map.yaml"],
        ["identify", "run.mcap", "--rig", "model.yaml", "--out", "."],
        ["diagnose", "bag", "--out", "bag"],
    ],
)
def test_an_input_is_never_replaced(folder, record, refused, words):
    write_record(record, folder / "bag")
    rig = Path(__file__).parents[2] / "config" / "rigs" / f"{RIG}.yaml"
    for name in ("rig.yaml", "model.yaml"):
        (folder / name).write_text(rig.read_text())
    os.link(folder / "run.mcap", folder / "other.mcap")
    before = contents(folder)
    assert "is the input" in refused(*words, "--force")
    assert contents(folder) == before


@pytest.mark.parametrize("verb", ["design", "identify"])
def test_a_second_call_without_out_writes_beside_the_first(folder, verb):
    words = WRITERS[verb][0][:-2]
    assert [main(words) for _ in range(3)] == [0, 0, 0]
    name = f"{verb}-run" if verb == "identify" else verb
    assert sorted(p.name for p in (folder / "out").iterdir()) == [name, f"{name}-2", f"{name}-3"]


@pytest.mark.parametrize("name", ["it's \"two\"\nwords", "esc\x1b[2J\udce9\udcff ж 数"])
def test_any_name_of_an_output_works(folder, capsys, name):
    for out in (f"{name}.mcap", f"{name}.db3", name):
        assert main(["simulate", RIG, "--duration", "1", "--out", out]) == 0
        assert len(read_record(out)["command"]) == 280
    assert main(["predict", RIG, name, "--out", f"{name}.csv"]) == 0
    assert main(["identify", name, "--json", "--out", f"{name} results"]) == 0
    printed = capsys.readouterr()
    assert printed.err == "" and "\x1b" not in printed.out and "\udce9" not in printed.out


@pytest.mark.parametrize(
    ("option", "name"), [("--namespace", "\udcff"), ("--joint", "a\x1b[2J"), ("--topic", "a\nb")]
)
def test_a_name_of_ros_that_cannot_be_written_is_refused(folder, refused, option, name):
    line = refused(*WRITERS["simulate"][0], option, f"ft={name}" if option == "--topic" else name)
    assert "expected a name of ROS" in line and "\x1b" not in line
    assert not (folder / "out").exists()
