"""Whatever fails while results are written, at whatever step: old files stay, and no file is partial."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

import rsea_ros.files as files
import rsea_ros.replaced as replaced
from msg_adapters import read_record, write_record
from rsea_ros.checks import usable
from rsea_ros.checks.finding import Findings
from rsea_ros.cli import _checks, experiment, paper
from rsea_ros.cli.main import main
from rsea_ros.control import study
from rsea_ros.design import judge, tolerance
from rsea_ros.diagnosis import diagnose
from rsea_ros.errors import OutputError
from rsea_ros.experiment import advice, run_file
from rsea_ros.fleet import store_columns
from rsea_ros.identification import identify
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.laws import learn
from rsea_ros.model.rig_choice import RigChoice
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.report import file_names
from rsea_ros.report.control import json as control_json
from rsea_ros.report.control import page as control_page
from rsea_ros.report.design import json as design_json
from rsea_ros.report.design import page as design_page
from rsea_ros.report.diagnosis import files as diagnosis_files
from rsea_ros.report.experiment import json as experiment_json
from rsea_ros.report.experiment import page as experiment_page
from rsea_ros.report.fleet import files as fleet_files
from rsea_ros.report.identification import files as results
from rsea_ros.report.law import files as law_files
from rsea_ros.report.paper import json as paper_json
from rsea_ros.report.paper import page as paper_page
from rsea_ros.signals import Channel, Record

RIG = "paper_high_impedance"
STEPS = ("open", "pwrite", "fsync", "link", "rename")
MAP = "time: {column: t, unit: s}\nchannels:\n  command: {column: u, unit: N m}\n"
OLD, JSON = b"old", {"all": 1}


class Disk:
    """The system calls with which files.py writes; the n-th of them fails."""

    def __init__(self, n: int, misfire: Callable[[str], None]) -> None:
        self.left, self._misfire = n, misfire

    def __getattr__(self, name: str):
        call = getattr(os, name)
        if name not in STEPS:
            return call

        def counted(*arguments, **options):
            self.left -= 1
            if self.left == 0:
                self._misfire(name)
            return call(*arguments, **options)

        return counted


def full(name: str) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def stop(name: str) -> None:
    signal.raise_signal(signal.SIGTERM)


@dataclass(frozen=True)
class Found:
    """The interface of a result that the verbs use."""

    rig: None = None
    extended_rig: None = None
    rates: tuple[()] = ()
    verdict: str = ""
    feasible: bool = True
    faults: tuple[()] = ()
    remarks: tuple[()] = ()
    rig_choice: RigChoice = field(default_factory=RigChoice)
    base_rig: None = None
    laws: tuple[()] = ()
    at_floor: bool = False
    joints: tuple[str, ...] = ("knee",)
    command: tuple[()] = ()
    rate: float = 280.0
    excluded: Mapping[str, float] = field(default_factory=dict)

    @property
    def proposal(self) -> Found:
        """The run of an experiment."""
        return self


@pytest.fixture(scope="module")
def record() -> Record:
    u = excitation("white_noise", ExcitationSettings(duration=2.0))
    return synthesize(load_rig(RIG), Channel(np.arange(len(u)) / 280.0, u))


@pytest.fixture
def folder(record, tmp_path, monkeypatch) -> Path:
    """Return a working directory with inputs, in which verbs have their results without computing."""
    write_record(record, tmp_path / "run.mcap")
    (tmp_path / "map.yaml").write_text(MAP)
    (tmp_path / "run.csv").write_text("t,u\n0,1\n1,2\n2,3\n")
    monkeypatch.chdir(tmp_path)
    found = Found()
    for module, names, value in (
        (identify, "identify", found), (diagnose, "diagnose", found), (study, "study", found),
        (judge, "judge", found), (judge, "least_stiffness", 1.0), (tolerance, "robust_stiffness", np.inf),
        (usable, "check_diagnosable", None), (_checks, "check_record", Findings("run.mcap", RIG, (), ())),
        (results, "identification_json", JSON), (results, "identification_report", "page"),
        (diagnosis_files, "diagnosis_json", JSON), (diagnosis_files, "diagnosis_report", "page"),
        (diagnosis_files, "overlay_records", {"/rsea": record}),
        (results, "rig_text", "rig"), (diagnosis_files, "rig_text", "rig"),
        (control_json, "control_json", JSON), (control_page, "control_report", "page"),
        (design_json, "design_json", JSON), (design_page, "design_report", "page"),
        (paper_json, "paper_json", JSON), (paper_page, "paper_report", "page"),
        (learn, "learn", found), (law_files, "law_json", JSON), (law_files, "law_report", "page"),
        (law_files, "rig_text", "rig"), (experiment, "_possible", ((), {}, {})), (advice, "advise", found),
        (run_file, "run_text", "t,u"), (experiment_json, "advice_json", JSON),
        (experiment_page, "advice_page", "page"), (store_columns, "history", {}),
        (store_columns, "recordings", {}),
        (fleet_files, "fleet_trends", found), (fleet_files, "alarms_of", []), (fleet_files, "_steps", None),
        (fleet_files, "joint_page", "page"), (fleet_files, "fleet_page", "page"),
    ):  # fmt: skip
        monkeypatch.setattr(module, names, lambda *words, value=value, **named: value)
    monkeypatch.setattr(paper, "_tests", lambda args, new, tell: write_record(record, new.staged("one.mcap")))
    return tmp_path


WRITERS = {
    "simulate": (["simulate", RIG, "--duration", "1", "--out", "out/new.mcap"], ["new.mcap"]),
    "simulate to a directory": (["simulate", RIG, "--duration", "1", "--out", "out/new"], ["new"]),
    "import": (["import", "run.csv", "--map", "map.yaml", "--out", "out/new.mcap"], ["new.mcap"]),
    "predict": (["predict", RIG, "run.mcap", "--out", "out/new.csv"], ["new.csv"]),
    "export": (["export", "--mjcf", RIG, "--no-play", "--out", "out/new.xml"], ["new.xml"]),
    "export of another kind": (["export", "--urdf", RIG, "--out", "out/new.urdf"], ["new.urdf"]),
    "rig": (["rig", "new", "arm", "--out", "out/new.yaml"], ["new.yaml"]),
    "fleet": (["fleet", "report", "store", "--out", "out"], ["index.html", "joint-knee.html"]),
    "law": (["law", "run.mcap", "--json", "--out", "out"], list(file_names.LAW)),
    "experiment": (
        ["experiment", RIG, "--limits", "torque=1", "--json", "--out", "out"], list(file_names.EXPERIMENT)
    ),
    "design": (["design", "--json", "--out", "out"], ["design.json", "report.html"]),
    "identify": (["identify", "run.mcap", "--json", "--out", "out"], list(file_names.IDENTIFICATION)),
    "diagnose": (["diagnose", "run.mcap", "--json", "--out", "out"], list(file_names.DIAGNOSIS)),
    "control": (["control", "--json", "--out", "out"], ["control.json", "report.html"]),
    "paper": (["paper", "--json", "--out", "out"], ["one.mcap", "paper.json", "report.html"]),
}


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"" for p in folder.rglob("*")}


def misfires(monkeypatch, words: list[str], misfire: Callable[[str], None]) -> Iterator[int]:
    """Run a verb repeatedly, each time with a later step that fails, until none fails."""
    for n in range(1, 200):
        disk = Disk(n, misfire)
        with monkeypatch.context() as patch:
            patch.setattr(files, "os", disk)
            patch.setattr(replaced, "os", disk)
            status = main(words)
        yield status
        if disk.left > 0:
            assert n > 6
            return


@pytest.mark.parametrize("verb", WRITERS)
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


@pytest.mark.parametrize("verb", ["simulate to a directory", "predict", "identify"])
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


@pytest.mark.parametrize("verb", ["predict", "export", "identify", "design"])
def test_a_symbolic_link_is_not_followed(folder, capsys, verb):
    words, names = WRITERS[verb]
    (folder / "out").mkdir()
    (folder / "precious").write_bytes(OLD)
    (folder / "out" / names[0]).symlink_to(folder / "precious")
    assert main(words) == 2
    assert main([*words, "--force"]) == 2
    assert "is not a regular file, expected a new name" in capsys.readouterr().err
    assert (folder / "precious").read_bytes() == OLD
    assert [p.name for p in (folder / "out").iterdir()] == [names[0]]


@pytest.mark.parametrize("verb", ["predict", "simulate", "export", "identify", "simulate to a directory"])
def test_only_regular_files_are_replaced(folder, capsys, verb):
    """A pipe stands for devices: replacing /dev/null would take a system down."""
    words, names = WRITERS[verb]
    (folder / "out").mkdir()
    os.mkfifo(folder / "out" / names[0])
    assert main([*words, "--force"]) == 2
    line = capsys.readouterr().err
    assert "is not a regular file, expected a new name" in line and line.count("\n") == 1
    assert (folder / "out" / names[0]).is_fifo()
    with pytest.raises(OutputError, match="is not a regular file"):
        files.give_names([(folder / "run.csv", folder / "out" / names[0])], force=True)


@pytest.mark.parametrize(
    "words",
    [
        ["predict", RIG, "run.mcap", "--out", "run.mcap"],
        ["predict", "rig.yaml", "run.mcap", "--out", "./rig.yaml"],
        ["predict", RIG, "bag", "--out", "bag/bag.mcap"],
        ["predict", RIG, "run.mcap", "--out", "other.mcap"],
        ["simulate", "rig.yaml", "--out", "rig.yaml"],
        ["export", "--mjcf", "rig.yaml", "--out", "rig.yaml"],
        ["import", "run.csv", "--map", "map.yaml", "--out", "map.yaml"],
        ["identify", "run.mcap", "--rig", "model.yaml", "--out", "."],
        ["diagnose", "bag", "--out", "bag"],
    ],
)
def test_an_input_is_never_replaced(folder, record, capsys, words):
    write_record(record, folder / "bag")
    rig = Path(__file__).parents[2] / "config" / "rigs" / f"{RIG}.yaml"
    for name in ("rig.yaml", "model.yaml"):
        (folder / name).write_text(rig.read_text())
    os.link(folder / "run.mcap", folder / "other.mcap")
    before = contents(folder)
    assert main([*words, "--force"]) == 2
    line = capsys.readouterr().err
    assert "is the input" in line and line.count("\n") == 1
    assert contents(folder) == before


@pytest.mark.parametrize("verb", ["design", "identify", "diagnose", "control", "paper"])
def test_a_second_call_without_out_writes_beside_the_first(folder, capsys, verb):
    words = WRITERS[verb][0][:-2]
    assert [main(words) for _ in range(3)] == [0, 0, 0]
    name = f"{verb}-run" if verb in ("identify", "diagnose") else verb
    assert sorted(p.name for p in (folder / "out").iterdir()) == [name, f"{name}-2", f"{name}-3"]


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


@pytest.mark.parametrize("name", ["it's \"two\" words", "line\nbreak", "esc\x1b[2J", "\udce9\udcff", "ж 数"])
def test_any_name_of_an_output_works(folder, capsys, name):
    for out in (f"{name}.mcap", f"{name}.db3", name):
        assert main(["simulate", RIG, "--duration", "1", "--out", out]) == 0
        assert len(read_record(out)["command"]) == 280
    assert main(["predict", RIG, name, "--out", f"{name}.csv"]) == 0
    assert main(["identify", name, "--json", "--out", f"{name} results"]) == 0
    told = capsys.readouterr()
    assert told.err == "" and "\x1b" not in told.out and "\udce9" not in told.out


@pytest.mark.parametrize("option", ["--namespace", "--joint", "--topic"])
@pytest.mark.parametrize("name", ["\udcff", "a\x1b[2J", "a\nb"])
def test_a_name_of_ros_that_cannot_be_written_is_refused(folder, capsys, option, name):
    words = [*WRITERS["simulate"][0], option, f"ft={name}" if option == "--topic" else name]
    assert main(words) == 2
    line = capsys.readouterr().err
    assert "expected a name of ROS" in line and line.count("\n") == 1 and "\x1b" not in line
    assert not (folder / "out").exists()
