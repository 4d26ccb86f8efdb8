"""Verbs and export targets of other packages, by their entry points; what is said where they are missing."""

from __future__ import annotations

import importlib.metadata
import importlib.util

import pytest

from rsea_ros import plugins
from rsea_ros.cli import main as cli
from rsea_ros.cli.export import abouts, exporter

MISSING = "rsea_extras: not installed, expected for"
INSTALL = "pip install . in the source of rsea_ros\n"
VERB = """HELP = "greet a machine"
EXAMPLE = "rsea greet"


def add_arguments(parser):
    parser.add_argument("--name", default="rsea")


def run(args):
    print("good morning,", args.name)
    return 0
"""


@pytest.fixture(autouse=True)
def forgotten():
    """Forget what was read before and in a test."""
    forget()
    yield
    forget()


def forget():
    plugins.in_extras.cache_clear()
    plugins.installed.cache_clear()


@pytest.fixture
def other(tmp_path, monkeypatch):
    """A package of somebody else, as pip leaves it."""
    (tmp_path / "greeting.py").write_text(VERB)
    info = tmp_path / "greeting-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Name: greeting\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[console_scripts]\ngreet = greeting:run\n\n[rsea_ros.verbs]\ngreet=greeting\nidentify = greeting\n\n"
        "[rsea_ros.exports]\nclay = greeting:run\n"
    )
    monkeypatch.syspath_prepend(tmp_path)


@pytest.fixture
def bare(monkeypatch):
    """An installation without the extras."""
    found = importlib.util.find_spec
    without = lambda name: None if name == plugins.EXTRAS else found(name)  # noqa: E731
    monkeypatch.setattr(importlib.util, "find_spec", without)


def test_a_verb_of_another_package_is_listed_and_runs(other, capsys):
    assert cli.main(["--help"]) == 0
    assert "greet       greet a machine" in capsys.readouterr().out
    assert cli.main(["greet", "--name", "hip"]) == 0
    assert capsys.readouterr().out == "good morning, hip\n"


def test_no_package_replaces_a_verb_of_this_one(other):
    assert cli.verbs()["identify"] == cli.module_of("identify") == "rsea_ros.cli.identify"


def test_a_target_of_another_package_is_offered(other):
    assert abouts()["clay"] == "target of greeting:run" and exporter("clay").__module__ == "greeting"


def test_entry_points_are_read_as_importlib_reads_them(other):
    for group in (plugins.VERBS, plugins.TARGETS, "console_scripts"):
        theirs = {each.name: each.value for each in importlib.metadata.entry_points(group=group)}
        assert plugins.installed(group) == theirs | plugins.in_extras(group) and theirs


def test_a_verb_of_this_package_reads_no_metadata(monkeypatch):
    monkeypatch.setattr(plugins, "installed", lambda group: pytest.fail("looked through everything"))
    assert cli.module_of("identify") == "rsea_ros.cli.identify"


@pytest.mark.parametrize("verb", cli.EXTRA)
def test_a_verb_that_is_not_installed_says_how_to_get_it(bare, verb, capsys):
    assert cli.main([verb, "--help"]) == 2
    assert capsys.readouterr().err == f"rsea: {MISSING} rsea {verb}: {INSTALL}"
    assert verb not in cli.verbs()


def test_a_target_that_is_not_installed_says_how_to_get_it(bare, capsys, tmp_path):
    assert cli.main(["export", "--urdf", "pendulum", "--no-play", "--out", str(tmp_path / "never.urdf")]) == 2
    assert capsys.readouterr().err == f"rsea export: {MISSING} --urdf: {INSTALL}"
