"""The command line: verbs are found without being imported, every expected error is one line and a status."""

import argparse
import errno
import importlib
import os
import signal
import subprocess
import sys
import time
import types
from collections.abc import Callable
from pathlib import Path

import pytest
from numpy.linalg import LinAlgError

from rsea_ros.cli import main as cli
from rsea_ros.errors import BagError, DeviceError

ROOT = Path(__file__).resolve().parents[2]


def run_python(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run this interpreter in the repository."""
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=60)


@pytest.fixture
def verb(monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Return a function that runs `rsea fake …`, a verb that calls the given function."""

    def run(action: Callable[[argparse.Namespace], int], *arguments: str) -> int:
        module = types.ModuleType("rsea_ros.cli.fake")
        module.HELP = "fake"
        module.EXAMPLE = "rsea fake"
        module.add_arguments = lambda parser: parser.add_argument("--number", type=int)
        module.run = action
        monkeypatch.setitem(sys.modules, "rsea_ros.cli.fake", module)
        monkeypatch.setattr(cli, "core_verbs", lambda: {"fake": "rsea_ros.cli.fake"})
        return cli.main(["fake", *arguments])

    return run


def raise_error(error: BaseException) -> Callable[[argparse.Namespace], int]:
    """Return a verb that raises the error."""

    def run(args: argparse.Namespace) -> int:
        raise error

    return run


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (BagError("run.mcap: 3 messages,\n expected 9"), 2, "rsea fake: run.mcap: 3 messages, expected 9"),
        (DeviceError("port /dev/ttyUSB0 silent"), 2, "rsea fake: port /dev/ttyUSB0 silent"),
        (OSError(errno.ENOSPC, "No space left on device", "out/a.html"), 2,
         "rsea fake: out/a.html: No space left on device"),
        (OSError("something about a file"), 2, "rsea fake: something about a file"),
        (KeyboardInterrupt(), 130, "rsea fake: interrupted"),
    ],
)
def test_an_expected_error_is_one_line_and_a_status(verb, capsys, error, status, line):
    assert verb(raise_error(error)) == status
    assert capsys.readouterr() == ("", line + "\n")


@pytest.mark.parametrize("error", [ZeroDivisionError, MemoryError, KeyError, LinAlgError])
def test_an_error_that_nobody_expected_is_one_line_too(verb, capsys, monkeypatch, error):
    assert verb(raise_error(error("7 pears"))) == 2
    printed, line = capsys.readouterr()
    assert (printed, line.count("\n")) == ("", 1)
    assert line.startswith(f"rsea fake: {cli.FAULT}: {error.__name__} in test_main.py:") and "7 pears" in line
    monkeypatch.setenv("RSEA_TRACEBACK", "1")
    assert verb(raise_error(error("7 pears"))) == 2
    assert "Traceback" in capsys.readouterr().err


def test_an_interrupt_that_an_import_turns_into_another_error_is_an_interrupt(verb, capsys):
    def run(args: argparse.Namespace) -> int:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("numpy.core.multiarray failed to import") from None
        return 0

    assert verb(run) == 130
    assert capsys.readouterr() == ("", "rsea fake: interrupted\n")


@pytest.mark.parametrize(
    ("number", "line"),
    [
        (signal.SIGINT, "interrupted"),
        (signal.SIGTERM, "stopped by SIGTERM"),
        (signal.SIGHUP, "stopped by SIGHUP"),
    ],
)
def test_signals_are_one_line_and_their_status(verb, capsys, number, line):
    before = signal.getsignal(number)
    assert verb(lambda args: signal.raise_signal(number) or 0) == 128 + number
    assert capsys.readouterr() == ("", f"rsea fake: {line}\n")
    assert signal.getsignal(number) == before


def test_groups_name_folders_that_exist_and_other_words_go_to_pytest(monkeypatch):
    module = importlib.import_module("rsea_ros.cli.test")
    missing = {p for paths in module.GROUPS.values() for p in paths if not (ROOT / p).exists()}
    assert missing in (set(), {"test/extras/nodes", "test/extras/trends"}), "a tree without the extras"
    asked = []
    done = types.SimpleNamespace(wait=int)
    pytest_of = types.SimpleNamespace(Popen=lambda words, cwd, env: asked.append(words) or done)
    monkeypatch.setattr(module, "subprocess", pytest_of)
    assert cli.main(["test", "safety", "-x"]) == cli.main(["test", "all"]) == 0
    assert asked[0][-1] == "-x" and set(module.GROUPS["safety"]) - missing < set(asked[0])
    assert not [word for word in asked[1] if word.startswith("test")]


def test_a_stop_that_a_destructor_swallows_is_asked_for_again(verb, capsys):
    class Deaf:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def run(args: argparse.Namespace) -> int:
        Deaf()
        time.sleep(60.0)
        return 0

    before = time.monotonic()
    assert verb(run) == 130
    assert time.monotonic() - before < 30.0
    assert capsys.readouterr() == ("", "rsea fake: interrupted\n")


HOSTILE = "ft\x1b]0;title\x07\x1b[2J\x9b1m\u202ecod\udce9\r"


def test_control_characters_reach_no_terminal(verb, capsys):
    assert verb(lambda args: sys.stdout.write(HOSTILE + "\n") and 0) == 0
    assert verb(raise_error(BagError(HOSTILE))) == 2
    told = capsys.readouterr()
    shown = "ft\\u001b]0;title\\u0007\\u001b[2J\\u009b1m\\u202ecod\\udce9"
    assert told == (f"{shown}\\u000d\n", f"rsea fake: {shown}\n")


def test_any_encoding_will_do():
    code = (
        "import sys, types; from rsea_ros.cli import main as cli\n"
        "from rsea_ros.errors import BagError\n"
        "def run(args): print('3 N·m ± 1 µrad 数'); raise BagError('b\\xe4g')\n"
        "fake = types.SimpleNamespace(HELP='', EXAMPLE='', add_arguments=lambda parser: 0, run=run)\n"
        "sys.modules['rsea_ros.cli.fake'] = fake\n"
        "cli.core_verbs = lambda: {'fake': 'rsea_ros.cli.fake'}; sys.exit(cli.main(['fake']))"
    )
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True)
    assert done.returncode == 2
    assert (done.stdout, done.stderr) == (b"3 N*m +- 1 urad \\u6570\n", b"rsea fake: b\\xe4g\n")


def test_a_full_disk_under_stdout_is_one_line():
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "rsea_ros", "--help"]
        done = subprocess.run(command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (2, "rsea: No space left on device\n")


def test_code_from_outside_the_package_is_announced(verb, capsys, monkeypatch):
    monkeypatch.setenv("RSEA_EFFECTS", "/mine")
    assert verb(lambda args: 0) == 0
    line = "rsea fake: RSEA_EFFECTS=/mine: code from there runs as part of this program\n"
    assert capsys.readouterr() == ("", line)


@pytest.mark.parametrize("arguments", [["--number", "many"], ["--what"]])
def test_wrong_arguments_exit_with_2(verb, capsys, arguments):
    with pytest.raises(SystemExit) as leaving:
        verb(lambda args: 0, *arguments)
    assert leaving.value.code == 2
    assert arguments[-1] in capsys.readouterr().err


def test_verbs_are_the_files_beside_main(tmp_path, monkeypatch):
    for name in ("__init__", "_table", "main", "import_", "play"):
        (tmp_path / f"{name}.py").touch()
    monkeypatch.setattr(cli, "__file__", str(tmp_path / "main.py"))
    assert cli.core_verbs() == {"import": "rsea_ros.cli.import_", "play": "rsea_ros.cli.play"}


@pytest.mark.parametrize(
    "source", ['HELP = "what it does"\n', 'HELP: str = "what it does"\n', 'HELP = ("what "\n "it does")\n']
)
def test_summary_reads_help_without_importing(tmp_path, monkeypatch, source):
    (tmp_path / "summed_up.py").write_text("import no_such_module\n" + source)
    monkeypatch.syspath_prepend(tmp_path)
    assert cli.summary("summed_up") == "what it does"


def test_only_the_chosen_verb_is_imported_and_nothing_heavy():
    code = ("import sys; from rsea_ros.cli.main import main; main(['--help'])\n"
            "try: main(['call', '--help'])\n"
            "except SystemExit: pass\n"
            "print([m for m in sys.modules if m.startswith('rsea_ros.cli.') and '._' not in m])\n"
            "print({'numpy', 'scipy', 'rclpy', 'numba', 'rich', 'plotly'} & set(sys.modules))")
    done = run_python("-c", code)
    assert done.stdout.splitlines()[-2:] == ["['rsea_ros.cli.main', 'rsea_ros.cli.call']", "set()"]
    assert done.stderr == ""


def test_a_closed_pipe_is_quiet():
    read_end, write_end = os.pipe()
    os.close(read_end)
    command = [sys.executable, "-m", "rsea_ros", "--help"]
    with os.fdopen(write_end, "w") as pipe:
        done = subprocess.run(command, cwd=ROOT, stdout=pipe, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize("name", ["stdin", "stdout", "stderr"])
def test_a_standard_stream_that_the_parent_closed_is_the_null_device(name, monkeypatch):
    monkeypatch.setattr(sys, name, None)
    assert cli.main(["maps"]) == 0
    assert getattr(sys, name) is None
