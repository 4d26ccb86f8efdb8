"""A node that does not end when it is asked to is ended, and says where it stood."""

import signal
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import sys, time
from rsea_ros.nodes._run import Component, Program

class Stuck(Program):
    def __init__(self, node, values):
        self.node = node

    def is_finished(self):
        self.node.get_logger().info("looked", once=True)
        while {stuck}:
            time.sleep(1e6)
        return False

sys.exit(Component("stuck", (), Stuck, patience=0.5).run())
"""


def test_a_node_without_unfinished_work_ends_after_its_patience():
    """model outlived SIGINT until SIGKILL, and nobody knew where."""
    programs = {
        stuck: subprocess.Popen(
            [sys.executable, "-c", PROGRAM.format(stuck=stuck)], cwd=ROOT, stderr=subprocess.PIPE, text=True
        )
        for stuck in (True, False)
    }
    for stuck, process in programs.items():
        assert "looked" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=50.0)[1]
        assert process.returncode == stuck
        assert ("in is_finished" in said) == stuck
