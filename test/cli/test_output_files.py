"""Output: never an input, a link or a device; old files stay whatever fails, and no file is partial."""

import errno
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from bad_input import Calls
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


STEPS = ("open", "pwrite", "fsync", "link", "rename")


def full(name: str) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def stop(name: str) -> None:
    signal.raise_signal(signal.SIGTERM)


def misfires(monkeypatch, words, misfire, every: int = 1) -> Iterator[int]:
    """Run a verb repeatedly, each time with a later step that fails, until none fails."""
    for n in range(1, 200, every):
        disk = Calls(STEPS, n, misfire)
        with monkeypatch.context() as patch:
            patch.setattr(files, "os", disk)
            status = main(words)
        yield status
        if disk.left > 0:
            assert n > 6
            return


BY_STEP = ("simulate to a directory", "identify")


@pytest.mark.parametrize("verb", BY_STEP)
def test_an_error_at_any_step_leaves_what_was_there(folder, monkeypatch, capsys, verb):
    words, names = WRITERS[verb]
    (folder / "out").mkdir()
    before = contents(folder)
    for status in misfires(monkeypatch, words, full):
        printed, line = capsys.readouterr()
        if status == 0:
            break
        assert (status, printed, line.count("\n")) == (2, "", 1), line
        assert "No space left on device" in line and ".rsea-" not in line and "out" in line, line
        assert contents(folder) == before
    assert sorted(p.name for p in (folder / "out").iterdir()) == sorted(names)


@pytest.mark.parametrize("verb", WRITERS)
def test_an_error_at_any_step_of_a_replacement_leaves_the_old(folder, monkeypatch, capsys, verb):
    words, names = WRITERS[verb]
    (folder / "out").mkdir()
    for name in names:
        old = folder / "out" / name / "new.mcap" if name == "new" else folder / "out" / name
        old.parent.mkdir(exist_ok=True)
        old.write_bytes(OLD)
    before = contents(folder)
    assert main(words) == 2
    assert "exists already, expected a new name or --force" in capsys.readouterr().err
    every = 1 if verb in BY_STEP else 6  # all write by the same code
    for status in misfires(monkeypatch, [*words, "--force"], full, every):
        if status == 0:
            break
        assert contents(folder) == before
    assert OLD not in contents(folder / "out").values()
    assert sorted(p.name for p in (folder / "out").iterdir()) == sorted(names)


def test_a_signal_at_any_step_leaves_all_or_nothing(folder, monkeypatch, capsys):
    words, names = WRITERS["identify"]
    outcomes = set()
    (folder / "out").mkdir()
    for status in misfires(monkeypatch, words, stop):
        left = sorted(p.name for p in (folder / "out").iterdir())
        outcomes.add((status, len(left)))
        assert left in ([], sorted(names))
        for name in left:
            files.remove(folder / "out" / name)
        if status == 143:
            assert capsys.readouterr().err == f"rsea {words[0]}: stopped by SIGTERM\n"
    assert (143, 0) in outcomes and (0, len(names)) in outcomes


def test_two_runs_at_once_do_not_take_one_name(folder, monkeypatch, capsys):
    """The other run ends first, between the check of the name and its use."""

    def other(name: str) -> None:
        if name == "link":
            (folder / "out" / "new.csv").write_bytes(OLD)

    (folder / "out").mkdir()
    words = WRITERS["predict"][0]
    statuses = []
    for status in misfires(monkeypatch, words, other):
        statuses.append(status)
        if status == 2:
            assert (folder / "out" / "new.csv").read_bytes() == OLD
            assert "exists already" in capsys.readouterr().err
        (folder / "out" / "new.csv").unlink()
    assert sorted(set(statuses)) == [0, 2]
