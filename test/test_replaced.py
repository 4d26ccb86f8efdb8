"""After a kill at any step, files that --force replaces are old or new as a whole; nothing is lost."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rsea_ros.outputs import files
from rsea_ros.outputs.files import (
    LEFT_AFTER,
    OLD,
    check_free,
    make_locked,
    make_stage,
    name_of,
    put_back,
    remove_left,
)

CALLS = ("link", "rename", "fsync", "unlink", "rmdir")


class Killer:
    """The system's calls; before the n-th of CALLS the process is killed, as by `kill -9`."""

    def __init__(self, n: int) -> None:
        self._left = n

    def __getattr__(self, name: str):
        call = getattr(os, name)
        if name not in CALLS:
            return call

        def count(*arguments, **options):
            self._left -= 1
            if self._left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return call(*arguments, **options)

        return count


def kill_after(work: Callable[[], object], n: int) -> bool:
    """Do the work in a child that is killed before its n-th step; return whether it reached that step."""
    pid = os.fork()
    if pid == 0:
        files.os = Killer(n)
        try:
            work()
        finally:
            os._exit(0)
    return os.waitpid(pid, 0)[1] == signal.SIGKILL


def give_set(folder: Path) -> None:
    stage = make_stage(folder)
    for name in "abc":
        (stage.path / name).write_text("new")
    files.give_names([(stage.path / name, folder / name) for name in "abc"], force=True)
    stage.remove()


def give_bag(folder: Path) -> None:
    stage = make_stage(folder)
    (stage.path / "bag.mcap").write_text("new")
    files.give_names([(stage.path, folder / "bag")], force=True)
    stage.release()


def old_set(folder: Path) -> None:
    for name in "abc":
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
    assert all(one in (dict.fromkeys("abc", "old"), dict.fromkeys("abc", "new")) for one in seen)
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
