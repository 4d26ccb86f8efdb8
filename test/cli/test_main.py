"""The command line: verbs are found without being imported, every expected error is one line and a status."""

from __future__ import annotations

import argparse
import errno
import os
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path

import pytest

from rsea_ros.cli import main as cli
from rsea_ros.errors import BagError, DeviceError

ROOT = Path(__file__).resolve().parents[2]


def run_python(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run this interpreter in the repository."""
    return subprocess.run([sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=60)


@pytest.fixture
def verb(monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Return a function that runs `rsea fake …`, where the verb does what it is given."""

    def run(action: Callable[[argparse.Namespace], int], *arguments: str) -> int:
        module = types.ModuleType("rsea_ros.cli.fake")
        module.HELP = "fake"
        module.add_arguments = lambda parser: parser.add_argument("--number", type=int)
        module.run = action
        monkeypatch.setitem(sys.modules, "rsea_ros.cli.fake", module)
        monkeypatch.setattr(cli, "verbs", lambda: {"fake": Path("fake.py")})
        return cli.main(["fake", *arguments])

    return run


def raising(error: BaseException) -> Callable[[argparse.Namespace], int]:
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
    assert verb(raising(error)) == status
    assert capsys.readouterr() == ("", line + "\n")


def test_a_bug_is_not_hidden(verb):
    with pytest.raises(ZeroDivisionError):
        verb(lambda args: 1 // 0)


def test_the_verbs_status_is_the_exit_status(verb):
    assert verb(lambda args: args.number, "--number", "1") == 1


@pytest.mark.parametrize("arguments", [["--number", "many"], ["--what"]])
def test_wrong_arguments_exit_with_2(verb, capsys, arguments):
    with pytest.raises(SystemExit) as leaving:
        verb(lambda args: 0, *arguments)
    assert leaving.value.code == 2
    assert arguments[-1] in capsys.readouterr().err


def test_an_unknown_verb_is_named_beside_the_known(capsys):
    assert cli.main(["dance"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("rsea: no verb 'dance', expected one of: ")
    assert error.count("\n") == 1


def test_verbs_are_the_files_beside_main(tmp_path, monkeypatch):
    for name in ("__init__", "_table", "main", "import_", "play"):
        (tmp_path / f"{name}.py").touch()
    monkeypatch.setattr(cli, "__file__", str(tmp_path / "main.py"))
    assert list(cli.verbs()) == ["import", "play"]


def test_every_verb_has_a_line_of_help():
    lines = cli.overview().splitlines()
    for name, path in cli.verbs().items():
        assert cli.summary(path), path
        assert any(line.split()[:1] == [name] for line in lines)


@pytest.mark.parametrize(
    "source", ['HELP = "what it does"\n', 'HELP: str = "what it does"\n', 'HELP = ("what "\n "it does")\n']
)
def test_summary_reads_help_without_importing(tmp_path, source):
    file = tmp_path / "verb.py"
    file.write_text("import no_such_module\n" + source)
    assert cli.summary(file) == "what it does"


def test_help_imports_nothing_heavy():
    code = ("import sys; from rsea_ros.cli.main import main; main(['--help']);"
            "print({'numpy', 'scipy', 'rclpy', 'numba', 'rich', 'plotly'} & set(sys.modules))")
    done = run_python("-c", code)
    assert (done.stdout.splitlines()[-1], done.stderr) == ("set()", "")


def test_only_the_chosen_verb_is_imported():
    code = ("import sys; from rsea_ros.cli.main import main, verbs\n"
            "try: main(['test', '--help'])\n"
            "except SystemExit: pass\n"
            "print([m for m in sys.modules if m.startswith('rsea_ros.cli.')])")
    assert run_python("-c", code).stdout.splitlines()[-1] == "['rsea_ros.cli.main', 'rsea_ros.cli.test']"


def test_a_closed_pipe_is_quiet():
    read_end, write_end = os.pipe()
    os.close(read_end)
    command = [sys.executable, "-m", "rsea_ros", "--help"]
    with os.fdopen(write_end, "w") as pipe:
        done = subprocess.run(command, cwd=ROOT, stdout=pipe, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (141, "")


def test_the_test_verb_hands_its_arguments_to_pytest():
    options = ["-n", "0", "--collect-only", "test/cli/test_main.py", "-k", "hands_its"]
    done = run_python("-m", "rsea_ros", "test", *options)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "test_the_test_verb_hands_its_arguments_to_pytest" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("1/")


def test_the_test_verb_returns_the_status_of_pytest():
    assert run_python("-m", "rsea_ros", "test", "-n", "0", "test/cli/no_such_file.py").returncode == 4
