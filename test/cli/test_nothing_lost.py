"""Whatever fails while results are written, at whatever step: old files stay, and no file is partial."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from writing_verbs import OLD, WRITERS, contents, prepare

import rsea_ros.outputs.files as files
from rsea_ros.cli.main import main

STEPS = ("open", "pwrite", "fsync", "link", "rename")


class Disk:
    """The system calls with which files.py writes; the n-th of them fails."""

    def __init__(self, n: int, misfire: Callable[[str], None]) -> None:
        self.left, self._misfire = n, misfire

    def __getattr__(self, name: str):
        call = getattr(os, name)
        if name not in STEPS:
            return call

        def count(*arguments, **options):
            self.left -= 1
            if self.left == 0:
                self._misfire(name)
            return call(*arguments, **options)

        return count


def full(name: str) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def stop(name: str) -> None:
    signal.raise_signal(signal.SIGTERM)


@pytest.fixture
def folder(record, tmp_path, monkeypatch) -> Path:
    """Return a working directory with inputs, in which verbs have their results without computing."""
    prepare(record, tmp_path, monkeypatch)
    return tmp_path


def misfires(monkeypatch, words: list[str], misfire: Callable[[str], None]) -> Iterator[int]:
    """Run a verb repeatedly, each time with a later step that fails, until none fails."""
    for n in range(1, 200):
        disk = Disk(n, misfire)
        with monkeypatch.context() as patch:
            patch.setattr(files, "os", disk)
            status = main(words)
        yield status
        if disk.left > 0:
            assert n > 6
            return


@pytest.mark.parametrize("verb", ["simulate to a directory", "identify"])
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
    for status in misfires(monkeypatch, [*words, "--force"], full):
        if status == 0:
            break
        assert contents(folder) == before
    assert OLD not in contents(folder / "out").values()
    assert sorted(p.name for p in (folder / "out").iterdir()) == sorted(names)


@pytest.mark.parametrize("verb", ["simulate to a directory", "identify"])
def test_a_signal_at_any_step_leaves_all_or_nothing(folder, monkeypatch, capsys, verb):
    words, names = WRITERS[verb]
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
