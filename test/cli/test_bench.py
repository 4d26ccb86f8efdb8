"""`rsea bench` as a program: it prints its addresses, obeys requests, and leaves nothing behind."""

import json
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import pytest
import yaml

from bench.__main__ import _parser, _print, index, main as run_bench
from bench.frozen.cases import generated
from bench.mutants import calls as callers
from bench.results import read_lines, resumed, write_pages
from rsea_ros.cli.launch import node_calls
from rsea_ros.errors import DeviceError
from rsea_ros.hardware.peer.remote import RemoteBench
from rsea_ros.model.rig_file import load_rig, rig_folders
from test.nodes.warm import Bench

ROOT = Path(__file__).resolve().parents[2]


def start(*words):
    command = [sys.executable, "-m", "rsea_ros", "bench", *map(str, words)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_it_prints_its_addresses_and_a_signal_removes_the_port(tmp_path):
    """To be stopped is its regular end."""
    process = start("--port", tmp_path / "tty", "--model", 2020)
    place = json.loads(process.stdout.readline())
    assert place["port"] == str(tmp_path / "tty") and place["model"] == 2020
    assert (tmp_path / "tty").is_char_device() and place["ft_port"] != place["page_port"]
    words = shlex.split(place["launch"])  # of a clone in a folder whose name has a blank, too
    driver, *others = node_calls(words[2], words[3:])
    patience = yaml.safe_load(driver.file.read_text())["/**"]["ros__parameters"]
    assert patience["lost_cycles"] > 3, "a busy machine delays the process that stands for a motor"
    assert "identify" not in [node.name for node in others], "it ends the graph when it cannot fit"
    assert words[:2] == ["rsea", "launch"] and driver.parameters["ft_page_port"] == str(place["page_port"])
    process.send_signal(signal.SIGHUP)
    _, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (0, "")
    assert not (tmp_path / "tty").is_symlink()


def test_drives_on_can_are_behind_an_adapter_and_the_launch_names_them(tmp_path, refused):
    with Bench(tmp_path / "tty", "--can", "RS03", "DM8009") as bench:
        given, (driver, *_) = bench.parameters(), node_calls("hardware", shlex.split(bench.launch)[3:])
        assert bench.torque(1) == (0, False)
    for name, value in {"device": "mit_can", "can_model": "RS03", "can_interface": "slcan"}.items():
        assert given[name] == driver.parameters[name] == value
    line = refused("bench", "--port", tmp_path / "tty", "--can", "RS03", "--deflection")
    assert "no drive reads an encoder" in line


def test_with_an_encoder_on_the_spring_there_is_no_ft_sensor(tmp_path):
    with RemoteBench(tmp_path / "tty", "--deflection") as bench:
        given, (driver, *_) = bench.parameters(), node_calls("hardware", shlex.split(bench.launch)[3:])
        for name, values in {"explode": {}, "misbehave": {"dropp": 1.0}, "set": {"colour": 3}}.items():
            with pytest.raises(DeviceError, match="expected one of misbehave, set, alert"):
                bench.ask(name, **values)
        assert bench.torque() == (0, False), "what it does not understand changes nothing"
    names = "encoder_id", "encoder_pulses", "ft_host"
    assert [given[name] for name in names] == [100, 2.0**20, ""]
    assert [driver.parameters[name] for name in names] == ["100", "1048576.0", "''"]


def test_an_encoder_needs_a_spring(refused):
    line = refused("bench", "--rig", "bare_drive", "--deflection")
    assert "--deflection: the spring of rig bare_drive is rigid" in line


def test_a_file_with_the_name_of_the_port_is_not_removed(tmp_path, refused):
    (tmp_path / "thesis.tex").write_text("precious")
    line = refused("bench", "--port", tmp_path / "thesis.tex")
    assert "thesis.tex: exists already, expected a new name" in line
    assert (tmp_path / "thesis.tex").read_text() == "precious"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--ft-rate", 9000), "rsea bench: --ft-rate 9000 Hz, expected 1 to 7000 Hz\n"),
        (("--return-delay", 300), "rsea bench: --return-delay 300, expected 0 to 254 (unit 2 µs)\n"),
    ],
)
def test_impossible_options_are_refused(words, message, refused):
    assert refused("bench", *words) == message


def test_the_tables_of_the_pages_are_the_kept_rows_of_the_benchmarks():
    assert write_pages(check=True) == 0


def test_every_benchmark_is_listed_with_what_it_measures(capsys):
    assert run_bench(["-h"]) == 0
    listed = capsys.readouterr().out
    assert all(what and f"{topic:12} {name}" in listed for topic, name, what in index())


def test_a_run_keeps_each_table_that_it_prints_by_rows_and_columns(capsys):
    def section():
        yield "found:"
        yield "x", "<= 1", {"b": "0|5"}
        yield "y", "", "z"
        return 1

    ((first,), (second,)), status = _print(section())
    assert first == ("x", "<= 1", {"b": "0|5"}) and second == ("y", "", "z") and status == 1
    assert capsys.readouterr().out.splitlines()[-1] == "| y |  | z |"


def section(
    step: Annotated[str, ("play", "table")], *, log: Path, seeds: tuple[int, ...] = (1,), exact: bool = False
):
    """Play.

    seeds: of records
    """


def test_the_command_line_of_a_section_is_its_signature(capsys):
    parser = _parser("frozen", {"play": section})
    given = parser.parse_args(["table", "--log", "a.jsonl", "--seeds", "2", "3"])
    assert vars(given) == {"step": "table", "log": Path("a.jsonl"), "seeds": [2, 3], "exact": False}
    with pytest.raises(SystemExit):
        parser.parse_args(["draw", "--log", "a.jsonl"])
    assert "'draw', expected one of play, table" in capsys.readouterr().err


def test_a_run_that_was_stopped_goes_on_with_its_log(tmp_path):
    works = [(name, lambda name=name: {"record": name}) for name in "ab"]
    assert [line["record"] for line in resumed(tmp_path / "log", works[:1], "record")] == ["a"]
    assert [line["record"] for line in resumed(tmp_path / "log", works, "record")] == ["b"]
    assert [line["record"] for line in read_lines(tmp_path / "log")] == ["a", "b"]


GENERATOR = """
from pathlib import Path

def cases(seed):
    yield f"stuck{seed}", ["coulomb_friction"]

def make(name, seed, folder):
    rows = "".join(f"{0.01 * k},{k % 7},{k % 5}\\n" for k in range(200))
    channels = "{command: {column: u, unit: N m}, ft: {column: y, unit: N m}}"
    Path(folder, "record.csv").write_text("t,u,y\\n" + rows)
    Path(folder, "map.yaml").write_text("time: {column: t, unit: s}\\nchannels: " + channels)
    Path(folder, "rig.yaml").write_text(Path("RIG").read_text())
"""


def test_generators_of_another_hand_are_played_from_their_folder(tmp_path):
    rig = next(folder / "paper_high_impedance.yaml" for folder in rig_folders())
    (tmp_path / "stuck_plant.py").write_text(GENERATOR.replace("RIG", str(rig)))
    entries = list(generated(tmp_path, [3, 4]))
    assert [entry.name for entry in entries] == ["stuck_plant-3/stuck3", "stuck_plant-4/stuck4"]
    played = entries[0].make()
    assert played.truth == ("coulomb_friction",) and len(played.record["ft"]) == 200
    assert played.rig.name == load_rig("paper_high_impedance").name


def test_a_long_test_leaves_room_for_the_shorter_ones_behind_it(monkeypatch):
    near, long, short = "test/laws/test_source.py", "test/cli/test_long.py", "test/cli/test_short.py"
    seconds, width = {near: 60.0, long: 31.0, short: 29.0}, {near: 1, long: 1, short: 2}
    known = callers.Calls({("laws/source", "f"): {near, long, short}}, seconds, width)
    monkeypatch.setattr(callers, "calls", lambda: known)
    monkeypatch.setattr(callers, "_imports", lambda unit, target: False)
    assert callers.tests_of("laws/source", "f") == ([near, short], [])
    seconds[long] = 29.0
    assert callers.tests_of("laws/source", "f") == ([near, long], [])
