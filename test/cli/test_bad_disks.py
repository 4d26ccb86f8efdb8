"""A full disk and a file without permission: one line, status 2, no partial files."""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
from pathlib import Path

from bad_input import ROOT, assert_refused, rsea

from msg_adapters import write_record

NOBODY = 65534


def small_files() -> None:
    """Let this process write no file above 40 kB: writing fails as on a full disk, with an error instead."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))


def test_a_disk_that_fills_up_under_a_bag_leaves_none(tmp_path, tmp_path_factory):
    roomy = tmp_path_factory.mktemp("roomy") / "bag"  # compiles all that runs with small files
    assert rsea("simulate", "paper_high_impedance", "--out", roomy).returncode == 0
    done = rsea("simulate", "paper_high_impedance", "--out", tmp_path / "bag", before=small_files)
    assert_refused(done, tmp_path / "bag", "File too large")
    assert list(tmp_path.iterdir()) == []


def as_nobody(*arguments: str | Path, once: tuple[str | Path, ...] = ()) -> subprocess.CompletedProcess[str]:
    """Run a verb without root's rights. once: run it as root before, so that its imports are compiled."""
    code = (
        "import contextlib, io, os, sys, msg_adapters, rsea_ros.cli.identify, rsea_ros.model.rig_file\n"
        "from rsea_ros.cli.main import main\n"
        f"once = {[str(a) for a in once]}\n"
        "with contextlib.redirect_stdout(io.StringIO()): assert not once or main(once) == 0\n"
        f"os.geteuid() or os.seteuid({NOBODY})\n"
        f"sys.exit(main({[str(a) for a in arguments]}))"
    )
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)


def reachable(folder: Path) -> None:
    for one in (folder, *folder.parents[:-2]):
        one.chmod(0o755)


def test_a_file_without_read_permission_is_refused(record, tmp_path):
    for name in ("open.mcap", "locked.mcap"):
        write_record(record, tmp_path / name)
    (tmp_path / "locked.mcap").chmod(0)
    reachable(tmp_path)
    before = ("identify", tmp_path / "open.mcap", "--out", tmp_path / "results")
    done = as_nobody("identify", tmp_path / "locked.mcap", once=before)
    assert_refused(done, tmp_path / "locked.mcap", "no permission to read it")
