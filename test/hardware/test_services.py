"""Unit files and container recipe of docs/hardware.md: they start what exists, the supervisor apart."""

import configparser
from pathlib import Path

import pytest
import yaml

from rsea_ros.nodes.driver import TABLE

ROOT = Path(__file__).resolve().parents[2]
SERVICES = ROOT / "launch" / "services"
SOCKET = "/run/rsea/supervisor"


def units():
    """Return the command of each service as words: of the unit files, then of the containers."""
    commands = {}
    for path in sorted(SERVICES.glob("*.service")):
        parser = configparser.ConfigParser(interpolation=None)
        parser.read(path)
        commands[path.name] = parser["Service"]["ExecStart"].split()
    for name, service in compose()["services"].items():
        commands[f"compose {name}"] = service["command"]
    return commands


def compose():
    """Return the containers."""
    return yaml.safe_load((SERVICES / "compose.yaml").read_text())


@pytest.mark.parametrize("name", units())
def test_a_service_runs_a_file_of_the_repository_at_one_socket(name):
    words = units()[name]
    files = [word.replace("/opt/rsea/", "") for word in words if word.endswith(".py")]
    modules = [f"{words[words.index('-m') + 1].replace('.', '/')}.py"] if "-m" in words else []
    assert files + modules and all((ROOT / file).is_file() for file in files + modules)
    assert any(SOCKET in word for word in words)


@pytest.mark.parametrize("name", [name for name in units() if "driver" in name])
def test_a_driver_gets_parameters_that_it_has(name):
    given = {word.partition(":=")[0] for word in units()[name] if ":=" in word}
    assert {"device", "supervisor"} <= given <= {parameter.name for parameter in TABLE}


def test_the_containers_share_nothing_but_the_socket_and_end_in_turn():
    supervisor, driver = (compose()["services"][name] for name in ("supervisor", "driver"))
    assert supervisor["volumes"] == driver["volumes"] == ["rsea:/run/rsea"]
    assert driver["depends_on"] == ["supervisor"] and supervisor["restart"] == "always"
    assert "devices" not in supervisor, "the port comes over the socket"
