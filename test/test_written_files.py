"""Stages and files put aside: a killed writer's go, a running one's stay; nothing is lost at any step."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bad_input import Calls

from msg_adapters import BagWriter
from rsea_ros.outputs import files
from rsea_ros.outputs.files import (
    LEFT_AFTER,
    OLD,
    PREFIX,
    STAGE,
    NewFiles,
    check_free,
    give_names,
    make_locked,
    make_stage,
    name_of,
    put_back,
    remove_left,
)

KILLED = (
    "import os, signal, sys; from pathlib import Path; from rsea_ros.outputs.files import make_stage\n"
    "stage = make_stage(Path(sys.argv[1]))\n"
    "(stage.path / 'report.html').write_text('half of it')\n"
    "os.kill(os.getpid(), signal.SIGKILL)"
)


def age(path: Path, seconds: float = 2.0 * LEFT_AFTER) -> Path:
    os.utime(path, (time.time() - seconds,) * 2)
    return path


def left_by_a_killed_writer(folder: Path) -> Path:
    done = subprocess.run([sys.executable, "-c", KILLED, folder], timeout=60, check=False)
    assert done.returncode == -signal.SIGKILL
    (path,) = folder.iterdir()
    assert path.name.startswith(PREFIX)
    return path


def leave_stage(folder: Path) -> Path:
    """Return a stage as a killed writer leaves it, without killing one."""
    stage = make_stage(folder)
    (stage.path / "report.html").write_text("half of it")
    stage.release()
    return age(stage.path)


def test_the_next_writer_removes_what_a_killed_one_left(tmp_path):
    path = left_by_a_killed_writer(tmp_path)
    remove_left(tmp_path)
    assert path.exists(), "younger than a minute"
    age(path)
    with NewFiles(tmp_path) as new:
        new.write("report.html", "whole")
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_writer_at_work_keeps_its_stage_however_old(tmp_path):
    with NewFiles(tmp_path) as first:
        first.write("first", "1")
        (stage,) = tmp_path.iterdir()
        age(stage)
        with NewFiles(tmp_path) as second:
            second.write("second", "2")
        assert stage.exists()
    assert {p.name for p in tmp_path.iterdir()} == {"first", "second"}


def test_a_bag_being_written_is_kept_and_lets_go_when_complete(tmp_path):
    with BagWriter(tmp_path / "bag", recording=False) as bag:
        age(bag.partial)
        remove_left(tmp_path)
        assert bag.partial.exists()
    assert [p.name for p in tmp_path.iterdir()] == ["bag"]
    assert bag._stage is None


def stage_of_another_machine(folder: Path) -> Path:
    path = leave_stage(folder)
    return age(path.rename(path.with_name(f"{PREFIX}stage-00000000-{path.name[-16:]}")))


def replaced_file(folder: Path) -> Path:
    """Return the only copy of a file, put aside by a writer that was killed while replacing it."""
    path = folder / f"{PREFIX}old-0123abcd"
    path.mkdir()
    return age(path)


def link_of_that_name(folder: Path) -> Path:
    (folder / "target").mkdir()
    path = folder / f"{name_of(STAGE)}0123456789abcdef"
    path.symlink_to(folder / "target")
    return path


def file_of_that_name(folder: Path) -> Path:
    path = folder / f"{name_of(STAGE)}0123456789abcdef"
    path.write_text("of somebody")
    return age(path)


KEPT = (stage_of_another_machine, replaced_file, link_of_that_name, file_of_that_name)


@pytest.mark.parametrize("make", KEPT)
def test_a_folder_that_is_not_a_leftover_stage_stays(tmp_path, make):
    path = make(tmp_path)
    remove_left(tmp_path)
    assert os.path.lexists(path)


def test_a_stage_of_another_user_stays(tmp_path, monkeypatch):
    path = leave_stage(tmp_path)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    remove_left(tmp_path)
    assert path.exists()


def test_files_put_aside_can_be_removed_only_once_all_new_ones_have_their_names(tmp_path, monkeypatch):
    source, target = tmp_path / "source", tmp_path / "target"
    for path in (source, target):
        path.mkdir()
        (path / "file").write_text(path.name)
    seen = []
    with monkeypatch.context() as patch:
        patch.setattr("rsea_ros.outputs.files.remove", seen.append)
        give_names([(source, target)], force=True)
    (aside,) = seen
    assert (aside / "target" / "file").read_text() == "target"
    assert (target / "file").read_text() == "source"
    age(aside)
    remove_left(tmp_path)
    assert not aside.exists()


def test_the_next_bag_removes_what_a_killed_writer_left(tmp_path):
    leave_stage(tmp_path)
    with BagWriter(tmp_path / "bag.mcap", recording=False):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["bag.mcap"]


CALLS = ("link", "rename", "fsync", "unlink", "rmdir")


def kill_after(work: Callable[[], object], n: int) -> bool:
    """Do the work in a child that is killed before its n-th step; return whether it reached that step."""
    pid = os.fork()
    if pid == 0:
        files.os = Calls(CALLS, n, lambda name: os.kill(os.getpid(), signal.SIGKILL))
        try:
            work()
        finally:
            os._exit(0)
    return os.waitpid(pid, 0)[1] == signal.SIGKILL


def give_set(folder: Path) -> None:
    stage = make_stage(folder)
    for name in "ab":
        (stage.path / name).write_text("new")
    files.give_names([(stage.path / name, folder / name) for name in "ab"], force=True)
    stage.remove()


def give_bag(folder: Path) -> None:
    stage = make_stage(folder)
    (stage.path / "bag.mcap").write_text("new")
    files.give_names([(stage.path, folder / "bag")], force=True)
    stage.release()


def old_set(folder: Path) -> None:
    for name in "ab":
        (folder / name).write_text("old")


def old_bag(folder: Path) -> None:
    (folder / "bag").mkdir()
    (folder / "bag" / "bag.mcap").write_text("old")


def later(folder: Path) -> None:
    """Make the content of a folder a minute older."""
    for path in (p for p in folder.iterdir() if p.name.startswith(".rsea-")):
        os.utime(path, (time.time() - 2.0 * LEFT_AFTER,) * 2)


def texts(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): p.read_text() for p in folder.rglob("*") if p.is_file()}


def outcomes(
    give: Callable[[Path], object], old: Callable[[Path], None], tmp_path: Path
) -> Iterator[dict[str, str]]:
    """Yield the content of a folder at the start of the next run, for a kill at each step."""
    for n in range(1, 100):
        folder = tmp_path / str(n)
        folder.mkdir()
        old(folder)
        was_killed = kill_after(lambda at=folder: give(at), n)
        check_free([folder / "another"])
        later(folder)  # for a folder that is empty: it might have been about to get its lock
        put_back(folder)
        remove_left(folder)
        assert not [p.name for p in folder.iterdir() if p.name.startswith(".rsea-")]
        yield texts(folder)
        if not was_killed:
            assert n > 6
            return


@pytest.mark.parametrize("links", [True, False])
def test_a_set_of_files_is_old_or_new_as_a_whole(tmp_path, monkeypatch, links):
    if not links:
        monkeypatch.setattr(files, "_link", lambda source, target: False)
    seen = list(outcomes(give_set, old_set, tmp_path))
    assert all(one in (dict.fromkeys("ab", "old"), dict.fromkeys("ab", "new")) for one in seen)
    assert seen[0] != seen[-1]


def test_a_bag_is_never_lost(tmp_path):
    seen = list(outcomes(give_bag, old_bag, tmp_path))
    for one in seen:
        assert one.pop("bag.old/bag.mcap", "old") == "old"
        assert one in ({"bag/bag.mcap": "old"}, {"bag/bag.mcap": "new"})
    assert seen[0] != seen[-1]


def aside(folder: Path, name: str) -> Path:
    """Return the folder in which a killed writer has put a file aside."""
    locked = make_locked(folder, OLD)
    (locked.path / name).write_text("old")
    locked.release()
    return locked.path


def test_a_file_that_has_taken_the_name_since_is_kept_too(tmp_path):
    aside(tmp_path, "a")
    (tmp_path / "a.old").write_text("of somebody")
    (tmp_path / "a").write_text("edited since")
    os.utime(tmp_path / "a", (time.time() + 5.0,) * 2)
    put_back(tmp_path)
    assert texts(tmp_path) == {"a": "edited since", "a.old": "of somebody", "a.old-2": "old"}


def test_files_put_aside_by_a_running_writer_stay(tmp_path):
    locked = make_locked(tmp_path, OLD)
    (locked.path / "a").write_text("old")
    put_back(tmp_path)
    assert (locked.path / "a").exists()
    locked.release()
    put_back(tmp_path)
    assert texts(tmp_path) == {"a": "old"}


def test_files_put_aside_by_another_user_or_machine_stay(tmp_path, monkeypatch):
    path = aside(tmp_path, "a")
    other = path.rename(tmp_path / path.name.replace(name_of(OLD), ".rsea-old-00000000-"))
    put_back(tmp_path)
    assert (other / "a").exists()
    mine = other.rename(path)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    put_back(tmp_path)
    assert (mine / "a").exists()


def test_a_file_that_cannot_be_put_back_stays_and_stops_nobody(tmp_path, monkeypatch):
    path = aside(tmp_path, "a")

    class Refusing:
        def __getattr__(self, name: str):
            return getattr(os, name)

        def rename(self, *names):
            raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(files, "os", Refusing())
    check_free([tmp_path / "b"])
    assert (path / "a").read_text() == "old"
