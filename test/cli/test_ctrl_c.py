"""A verb interrupted during its work."""

import signal
import subprocess
import sys
import time
from pathlib import Path

from bad_input import ROOT

from rsea_ros.processes import deaf_to_interrupts

LONG = ("simulate", "paper_high_impedance", "--duration", "600", "--out")


def test_ctrl_c_ends_a_verb_in_one_line_and_leaves_no_result(tmp_path):
    """One line, status 130, nothing under the final name."""
    out = tmp_path / "results"
    process = subprocess.Popen(
        [sys.executable, "-m", "rsea_ros", *LONG, str(out)],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while process.poll() is None:  # a library that is being imported may swallow one
        time.sleep(0.9)
        process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=30)
    assert process.returncode in (130, -signal.SIGINT)
    assert (stdout, stderr) == ("", "rsea simulate: interrupted\n")
    assert not out.exists() or not list(out.iterdir())


def test_processes_of_a_cluster_do_not_hear_the_terminal():
    """Dask's workers that were still importing printed 50 lines of tracebacks at a Ctrl-C of a fleet run."""
    with deaf_to_interrupts():
        child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    blocked = int(Path(f"/proc/{child.pid}/status").read_text().split("SigBlk:")[1].split()[0], 16)
    child.communicate(b"\n")
    assert blocked & 1 << (signal.SIGINT - 1)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, set())
