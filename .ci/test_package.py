"""The repository is an ament_python package: colcon builds it, and what it installs runs from there."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rclpy
import rclpy.qos

from msg_adapters.ros import JointState

ROOT = Path(__file__).resolve().parents[1]
EXECUTABLES = (
    "controller", "driver", "excite", "experiment", "health", "identify", "joint", "model", "plant", "record",
    "replay", "watch",
)  # fmt: skip


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a scratch workspace in which colcon has built the package."""
    place = tmp_path_factory.mktemp("workspace")
    colcon = [sys.executable, "-m", "colcon", "--log-base", "log", "build", "--base-paths", str(ROOT)]
    done = subprocess.run(colcon, cwd=place, env=environment(), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return place


def environment() -> dict[str, str]:
    """Return this environment without the source tree on Python's path."""
    search = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    return os.environ | {"PYTHONPATH": os.pathsep.join(place for place in search if place != str(ROOT))}


def start(workspace: Path, *command: str) -> subprocess.Popen[str]:
    """Start a command with the workspace sourced, as a user's shell would, away from the source tree."""
    line = f". ./install/setup.sh && exec {shlex.join(command)}"
    return subprocess.Popen(
        ["sh", "-c", line], cwd=workspace, env=environment(), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )


@pytest.fixture
def plant(workspace: Path) -> Iterator[subprocess.Popen[str]]:
    """Run the installed plant executable."""
    process = start(workspace, str(workspace / "install/rsea_ros/lib/rsea_ros/plant"))
    yield process
    process.kill()
    process.communicate()


def test_the_executables_are_where_ros2_run_looks(workspace):
    directory = workspace / "install/rsea_ros/lib/rsea_ros"
    assert {path.name for path in directory.iterdir() if os.access(path, os.X_OK)} == {*EXECUTABLES, "rsea"}
    marker = "install/rsea_ros/share/ament_index/resource_index/packages/rsea_ros"
    assert (workspace / marker).is_file()


@pytest.mark.parametrize("top", ["rsea_ros", "rsea_extras", "msg_adapters"])
def test_every_module_is_installed(workspace, top):
    (installed,) = (workspace / "install/rsea_ros/lib").glob(f"python3*/site-packages/{top}")
    assert files(installed, "*.py") == files(ROOT / top, "*.py")


def test_the_style_sheet_of_reports_is_installed(workspace):
    (installed,) = (workspace / "install/rsea_ros/lib").glob("python3*/site-packages/rsea_ros/report/page")
    assert {file.name for file in installed.glob("page.*")} == {"page.css", "page.js"}
    vendored = {file.name for file in (installed / "vendor").iterdir()}
    assert vendored == {"plotly-cartesian.LICENSE", "plotly-cartesian.min.js.gz"}


@pytest.mark.parametrize("top", ["config", "launch"])
def test_every_config_and_launch_file_is_installed(workspace, top):
    assert files(workspace / "install/rsea_ros/share/rsea_ros" / top, "*") == files(ROOT / top, "*")


def files(top: Path, pattern: str) -> set[str]:
    """Return the files under a directory, relative to it."""
    packaged = (path for path in top.rglob(pattern) if path.is_file() and path.suffix != ".pyc")
    return {str(path.relative_to(top)) for path in packaged}


def test_what_package_xml_asks_for_has_a_rosdep_key():
    """python3-threadpoolctl has none, so README's line for a colcon workspace ended in an error."""
    keys = set((ROOT / ".ci" / "rosdep-keys.txt").read_text().split("\n"))
    manifest = ElementTree.parse(ROOT / "package.xml").getroot()
    asked = {one.text for one in manifest if one.tag.endswith("depend")}
    assert "rclpy" in asked and not asked - keys


def test_rsea_is_a_command_of_the_sourced_workspace(workspace):
    with start(workspace, "rsea", "--help") as process:
        out, _ = process.communicate(timeout=60)
    assert process.returncode == 0, out
    assert out.startswith("usage: rsea VERB")


def test_the_installed_plant_publishes_until_it_is_interrupted(plant):
    heard: list[JointState] = []
    with rclpy.init():
        node = rclpy.create_node("listener", namespace="rsea")
        node.create_subscription(JointState, "joint_states", heard.append, rclpy.qos.qos_profile_sensor_data)
        deadline = time.monotonic() + 60.0
        while not heard and plant.poll() is None and time.monotonic() < deadline:
            rclpy.spin_once(node, timeout_sec=0.5)
        node.destroy_node()
    plant.send_signal(signal.SIGINT)
    out, _ = plant.communicate(timeout=30)
    assert heard, out
    assert len(heard[0].position) == len(heard[0].velocity) == len(heard[0].effort) == 1
    assert "Traceback" not in out
