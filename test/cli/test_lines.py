"""What verbs print fits a terminal of 80 columns and a log of 100; long work says what it does."""

import os
import sys
from io import StringIO

import pytest

from rsea_ros import compiler
from rsea_ros.cli import _terminal as _lines
from rsea_ros.cli.main import main
from rsea_ros.report.words import command_row, row, wrap

VERBS = [
    ["--help"], ["rigs"], ["maps"], ["effects"], ["effects", "structural_resonance"],
    ["rig", "check", "two_moving_outputs"], ["check", "run.mcap"], ["identify", "run.mcap"],
]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A bag of the default bench."""
    place = tmp_path_factory.mktemp("lines")
    arguments = ["simulate", "paper_high_impedance", "--duration", "8"]
    assert main([*arguments, "--out", str(place / "run.mcap")]) == 0
    return place


def test_a_verb_prints_no_line_wider_than_the_terminal(folder, monkeypatch, capsys):
    """A line of the demo had 400 characters."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(_lines, "width", lambda: 80)
    assert [main(words) for words in VERBS] == [0] * len(VERBS)
    assert [line for line in capsys.readouterr().out.splitlines() if len(line) > 80] == []


def test_words_stay_whole_and_a_command_stays_on_one_line():
    path = "a/" * 60 + "b"
    assert path in wrap(f"report: {path}", 80)
    command = f"rsea law {path} --rig model.yaml"
    assert command_row("law", "of the rest:", command, 80).splitlines() == [
        "law         of the rest:",
        f"            {command}",
    ]
    assert row("unclear", "word " * 30, 80).splitlines()[1].startswith("            word")


class Terminal(StringIO):
    """A stderr that is a terminal, or a pipe."""

    def __init__(self, tty):
        super().__init__()
        self._tty = tty

    def isatty(self):
        return self._tty


@pytest.mark.parametrize("tty", [True, False])
def test_the_first_compilation_is_said_once_on_a_terminal(tmp_path, monkeypatch, tty):
    """The first `rsea simulate` compiled for half a minute in silence."""
    monkeypatch.setattr(compiler, "_folder", lambda: os.fspath(tmp_path))
    compiler.tell_once.cache_clear()
    errors = Terminal(tty)
    monkeypatch.setattr(sys, "stderr", errors)

    def verb(words):
        for _ in range(2):
            assert compiler.njit(cache=True)(lambda x: 2 * x)(3) == 6
        return 0

    monkeypatch.setattr("rsea_ros.cli.main._run", lambda name, module, words: verb(words))
    assert main(["rigs"]) == 0
    said = "rsea: compiling the simulation for this machine: up to a minute, once\n"
    assert errors.getvalue() == (said if tty else "")
