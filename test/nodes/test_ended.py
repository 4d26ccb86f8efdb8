"""A node that does not end when it is asked to is ended, and says where it stood."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import sys, time
from rsea_ros.nodes._run import Component, Program

class Stuck(Program):
    def __init__(self, node, values):
        node.get_logger().info("begun")

    def is_finished(self):
        while {stuck}:
            time.sleep(1e6)
        return False

sys.exit(Component("stuck", (), Stuck, patience=0.5).run())
"""


@pytest.mark.parametrize(("stuck", "status"), [(True, 1), (False, 0)])
def test_a_node_without_unfinished_work_ends_after_its_patience(stuck, status):
    """model outlived SIGINT until SIGKILL, and nobody knew where."""
    command = [sys.executable, "-c", PROGRAM.format(stuck=stuck)]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True)
    assert "begun" in process.stderr.readline()
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=50.0)[1]
    assert process.returncode == status
    assert ("in is_finished" in said) == stuck
