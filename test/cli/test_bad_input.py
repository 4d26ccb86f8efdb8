"""Bad input to the program as a person runs it: one line of what and where, status 2, nothing half there."""

from __future__ import annotations

import io
import json
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from foreign import EPOCH, joint_state, write_foreign

from msg_adapters import write_record
from msg_adapters.writing import BagWriter
from rsea_ros.cli.main import main
from rsea_ros.identification.excitation import Settings, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.signals import Channel, Record

ROOT = Path(__file__).resolve().parents[2]
RIG = (ROOT / "config/rigs/paper_high_impedance.yaml").read_text(encoding="utf-8")
NOBODY = 65534


def rsea(*arguments: str | Path, before: Callable[[], None] | None = None):
    """Run a verb: here, or in a process of its own where something is to be done to that first."""
    command = [str(argument) for argument in arguments]
    if before is not None:
        return subprocess.run(
            [sys.executable, "-m", "rsea_ros", *command],
            cwd=ROOT, capture_output=True, text=True, timeout=60.0, preexec_fn=before, check=False,
        )  # fmt: skip
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        status = main(command)
    return subprocess.CompletedProcess(command, status, out.getvalue(), err.getvalue())


def refused(done: subprocess.CompletedProcess[str], *words: str | Path) -> None:
    """Hold the outcome to the contract: status 2 and one line with all that a person needs."""
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("rsea ")
    for word in words:
        assert str(word) in done.stderr, done.stderr


@pytest.fixture(scope="module")
def record() -> Record:
    u = excitation("white_noise", Settings(duration=4.0))
    return synthesize(load_rig("paper_high_impedance"), Channel(np.arange(len(u)) / 280.0, u))


@pytest.fixture
def out(tmp_path: Path) -> Iterator[Path]:
    """Give a directory for results in which nothing may be left."""
    yield tmp_path / "results"
    left = list((tmp_path / "results").glob("*"))
    assert not left, left


def changed(record: Record, name: str, k: int, *, y: float | None = None, t: float | None = None) -> Record:
    values, stamps = record[name].y.copy(), record[name].t.copy()
    values[k] = values[k] if y is None else y
    stamps[k] = stamps[k] if t is None else t
    return record.with_channels(**{name: Channel(stamps, values)})


def without(record: Record, *names: str) -> Record:
    return Record({n: c for n, c in record.channels.items() if n not in names})


def test_a_missing_topic(record, tmp_path, out):
    write_record(without(record, "command"), tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--out", out)
    refused(done, tmp_path / "bag", "no message on /rsea/torque_command", "the bag holds /rsea/ft")


def test_a_wrong_type(record, tmp_path, out):
    write_record(without(record, "ft"), tmp_path / "bag")
    stated = ["--topic", "ft=/rsea/joint_states", "--topic", "joint_states=/rsea/nothing"]
    done = rsea("identify", tmp_path / "bag", "--out", out, *stated)
    refused(
        done, "/rsea/joint_states is sensor_msgs/msg/JointState, expected geometry_msgs/msg/WrenchStamped"
    )


def test_an_empty_bag(tmp_path, out):
    with BagWriter(tmp_path / "bag", "mcap"):
        pass
    refused(rsea("identify", tmp_path / "bag", "--out", out), tmp_path / "bag", "holds no topic at all")


def test_an_empty_file(tmp_path, out):
    (tmp_path / "bag.mcap").touch()
    refused(rsea("identify", tmp_path / "bag.mcap", "--out", out), tmp_path / "bag.mcap", "empty file")


def test_a_truncated_mcap_opens_up_to_its_last_chunk(record, tmp_path):
    write_record(record, tmp_path / "whole.mcap")
    data = (tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(0.7 * len(data))])
    done = rsea("identify", tmp_path / "cut.mcap", "--out", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    assert "cut off" in done.stdout


def test_a_truncated_mcap_with_nothing_in_it(record, tmp_path, out):
    write_record(record, tmp_path / "whole.mcap")
    (tmp_path / "cut.mcap").write_bytes((tmp_path / "whole.mcap").read_bytes()[:60])
    refused(rsea("identify", tmp_path / "cut.mcap", "--out", out), tmp_path / "cut.mcap", "cut off")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_value_that_is_no_number(record, tmp_path, out, value):
    write_record(changed(record, "ft", 7, y=value), tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--out", out)
    refused(done, tmp_path / "bag", f"/rsea/ft wrench[7] is {value}", "expected a finite number")


@pytest.mark.parametrize(
    ("sample", "stamp", "kinds"),
    [(9, 3.3 / 280, ["stray_stamps", "dropped_samples"]), (11, 13.5 / 280, ["out_of_order"])],
)
def test_a_stamp_that_goes_back_is_told_and_the_rest_used(record, tmp_path, sample, stamp, kinds):
    write_record(changed(record, "ft", sample, t=stamp), tmp_path / "bag")
    assert main(["identify", str(tmp_path / "bag"), "--out", str(tmp_path / "found")]) == 0
    faults = json.loads((tmp_path / "found" / "identification.json").read_text())["data"]["faults"]
    assert [(f["kind"], f["channel"], f["size"]) for f in faults] == [(kind, "ft", 1) for kind in kinds]


def test_two_joints(tmp_path, out):
    """A command for one joint, states of two: which is meant must be said."""
    two = joint_state(EPOCH, ["hip", "knee"], [0.0, 1.0], [0.0, 1.0], [0.0, 1.0])
    rows = [
        ("/rsea/torque_command", EPOCH, joint_state(EPOCH, effort=[1.0])),
        ("/rsea/joint_states", EPOCH, two),
    ]
    bag = write_foreign(tmp_path / "bag", rows)
    done = rsea("identify", bag, "--out", out)
    refused(done, bag, "/rsea/joint_states: 2 joints (hip, knee), expected one; name it with --joint")
    refused(rsea("identify", bag, "--out", out, "--joint", "ankle"), bag, "no joint 'ankle'")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "value: 0.953",
            "value: -0.953",
            ("rotor.reflected_inertia = -0.953 kg m^2", "expected a finite value > 0"),
        ),
        ("value: 0.953", "value: heavy", ("rotor.reflected_inertia = 'heavy'", "expected a number (kg m^2)")),
        (
            "unit: kg m^2, spread",
            "unit: g m^2, spread",
            ("rotor.reflected_inertia.unit = 'g m^2'", "'kg m^2'"),
        ),
        ("chassis:", "chasis:", ("unknown key 'chasis'", "expected one of")),
        ("clamped: true", "clamped: 1", ("clamped = 1", "expected true or false")),
        (
            "known: [gear.ratio",
            "known: [gear.rate",
            ("known: 'gear.rate'", "expected a value that this rig states"),
        ),
    ],
)
def test_a_rig_that_makes_no_sense(record, tmp_path, out, old, new, words):
    write_record(record, tmp_path / "bag")
    assert old in RIG
    (tmp_path / "rig.yaml").write_text(RIG.replace(old, new, 1), encoding="utf-8")
    refused(
        rsea("identify", tmp_path / "bag", "--rig", tmp_path / "rig.yaml", "--out", out),
        tmp_path / "rig.yaml",
        *words,
    )


def test_a_rig_that_is_not_there(record, tmp_path, out):
    write_record(record, tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--rig", "papper", "--out", out)
    refused(done, "rig 'papper' not found", "paper_high_impedance")


def test_a_rig_that_the_data_contradict(record, tmp_path, out):
    write_record(without(record, "position"), tmp_path / "bag")
    done = rsea("identify", tmp_path / "bag", "--rig", "bare_drive", "--out", out)
    refused(done, tmp_path / "bag", "no position channel, expected one")


def test_a_bag_that_is_not_there(tmp_path, out):
    refused(rsea("identify", tmp_path / "nothing", "--out", out), tmp_path / "nothing", "no such bag")


def small_files() -> None:
    """Let this process write no file above 40 kB: writing fails as on a full disk, with an error instead."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))


def test_a_disk_that_fills_up_under_the_results(record, tmp_path):
    write_record(record, tmp_path / "bag")
    assert rsea("identify", tmp_path / "bag", "--out", tmp_path / "roomy").returncode == 0  # compiles it all
    done = rsea("identify", tmp_path / "bag", "--out", tmp_path / "results", before=small_files)
    refused(done, tmp_path / "results" / "report.html", "File too large")
    assert not (tmp_path / "results").exists()


def test_a_disk_that_fills_up_under_a_bag(tmp_path, tmp_path_factory):
    roomy = tmp_path_factory.mktemp("roomy") / "bag"  # compiles all that runs with small files
    assert rsea("simulate", "paper_high_impedance", "--out", roomy).returncode == 0
    done = rsea("simulate", "paper_high_impedance", "--out", tmp_path / "bag", before=small_files)
    refused(done, tmp_path / "bag", "File too large")
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full(record, tmp_path):
    write_record(record, tmp_path / "bag")
    done = rsea("predict", "paper_high_impedance", tmp_path / "bag", "--out", "/dev/full/x.csv")
    refused(done, "/dev/full")


def as_nobody(*arguments: str | Path, once: tuple[str | Path, ...] = ()) -> subprocess.CompletedProcess[str]:
    """Run a verb without root's rights. once: with root's, before, so that all that it imports is there."""
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


def test_a_reader_without_permission(record, tmp_path):
    for name in ("open.mcap", "locked.mcap"):
        write_record(record, tmp_path / name)
    (tmp_path / "locked.mcap").chmod(0)
    reachable(tmp_path)
    before = ("identify", tmp_path / "open.mcap", "--out", tmp_path / "results")
    done = as_nobody("identify", tmp_path / "locked.mcap", once=before)
    refused(done, tmp_path / "locked.mcap", "no permission to read it")


def test_a_folder_that_this_user_may_not_write_to(record, tmp_path):
    write_record(record, tmp_path / "bag.mcap")
    (tmp_path / "locked").mkdir(mode=0o555)
    reachable(tmp_path)
    bag = ("identify", tmp_path / "bag.mcap", "--out")
    done = as_nobody(*bag, tmp_path / "locked" / "results", once=(*bag, tmp_path / "open"))
    refused(done, tmp_path / "locked" / "results", "Permission denied")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--effect", "backlash:gap=wide"], ("--effect backlash:gap=wide", "expected NAME:param=value")),
        (["--effect", "warp"], ("effect 'warp'", "not in the catalogue")),
        (["--effect", "backlash:width=1"], ("backlash", "unknown parameter 'width'", "expected gap")),
        (["--duration", "-3"], ("duration = -3",)),
        (["--rate", "0"], ("rate = 0",)),
        (["--amplitude", "1e6"], ("100",)),
    ],
)
def test_simulations_that_make_no_sense(tmp_path, arguments, words):
    refused(rsea("simulate", "paper_high_impedance", "--out", tmp_path / "bag", *arguments), *words)
    assert list(tmp_path.iterdir()) == []


LONG = ("simulate", "paper_high_impedance", "--duration", "600", "--out")


@pytest.fixture(scope="module")
def long_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a bag that keeps a verb busy for seconds."""
    bag = tmp_path_factory.mktemp("long") / "bag"
    assert rsea(*LONG, bag).returncode == 0
    return bag


@pytest.mark.parametrize("verb", ["identify", "simulate", "predict"])
def test_ctrl_c(verb, long_bag, tmp_path):
    """Interrupted while it works: one line, status 130, nothing under the final name."""
    out = tmp_path / "results"
    arguments = {
        "simulate": [*LONG, out],
        "identify": ["identify", long_bag, "--out", out],
        "predict": ["predict", "paper_high_impedance", long_bag, "--out", out],
    }[verb]
    process = subprocess.Popen(
        [sys.executable, "-m", "rsea_ros", *map(str, arguments)],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while process.poll() is None:  # a library that is being imported may swallow one
        time.sleep(0.9)
        process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=30)
    assert process.returncode in (130, -signal.SIGINT)
    assert (stdout, stderr) == ("", f"rsea {verb}: interrupted\n")
    assert not out.exists() or not list(out.iterdir())
