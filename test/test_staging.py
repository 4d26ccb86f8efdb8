"""Stages: a killed writer's are removed by the next; those of a running writer or another user stay."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from msg_adapters import BagWriter
from rsea_ros.outputs.files import (
    LEFT_AFTER,
    PREFIX,
    STAGE,
    NewFiles,
    give_names,
    make_stage,
    name_of,
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
