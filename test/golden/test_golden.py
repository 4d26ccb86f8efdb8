"""One record through every verb: all that users see equals what is stored in `said/`, to a thousandth.

A refactoring that changes a number is a change: `./rsea test --renew` writes the files anew, and their
difference belongs into the commit.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from steps import DECLARED, INPUTS, SCRIPTS, VERBS
from written import as_json, differences, rounded, text_of

from rsea_ros.cli.main import main

SAID = Path(__file__).parent / "said"
ROOT = Path(__file__).parents[2]
RENEW = "RSEA_RENEW"


class Desk:
    """A folder in which steps run, each once; what one reads is made before."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._said = folder, dict[str, str]()

    def play(self, name: str) -> str:
        """Return all that a step prints and writes."""
        if name not in self._said:
            told = SCRIPTS[name](self.folder) if name in SCRIPTS else self._lines(name)
            parts = ["\n".join(told), *(text_of(p) for p in self._results(name))]
            text = "\n".join(part for part in parts if part)
            self._said[name] = text.replace(str(self.folder), "DESK").replace(str(ROOT), "ROOT") + "\n"
        return self._said[name]

    def _results(self, name: str) -> list[Path]:
        stem = Path(name).stem
        return sorted(p for p in self.folder.glob(f"{stem}*") if p.stem.rstrip("0123456789") == stem)

    def _lines(self, name: str) -> Iterator[str]:
        for line in VERBS[name]:
            for word in line.replace("=", " ").split():
                self._provide(word.partition("/")[0], name)
            yield from self._run(line)

    def _provide(self, word: str, name: str) -> None:
        """Make what a word names, if a step makes it or if it is an input."""
        if word in VERBS and word != name and list(VERBS).index(word) < list(VERBS).index(name):
            self.play(word)
        if word not in INPUTS or (self.folder / word).exists():
            return
        made = INPUTS[word]
        if callable(made):
            (self.folder / word).write_text(made())
        elif made.startswith("simulate"):
            list(self._run(made))
        else:
            (self.folder / word).write_text(made)

    def _run(self, line: str) -> Iterator[str]:
        words = [word.replace("+", " ") for word in line.split()]
        sys.argv = ["rsea", *words]
        with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
            try:
                status = main(words)
            except SystemExit as leaving:
                status = leaving.code
        told = [f"$ rsea {line}", as_json(out.getvalue()), rounded(err.getvalue())]
        yield from (text for text in told if text.strip())
        if status:
            yield f"status {status}"


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Desk]:
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("desk")
        patch.chdir(folder)
        patch.setattr(sys, "argv", sys.argv)
        patch.setenv("COLUMNS", "100")
        yield Desk(folder)


@pytest.mark.parametrize("name", [*VERBS, *SCRIPTS])
def test_it_says_what_it_said(desk: Desk, name: str) -> None:
    said, file = desk.play(name), SAID / f"{Path(name).stem}.txt"
    if os.environ.get(RENEW):
        file.write_text(said, encoding="utf-8")
    stored = file.read_text(encoding="utf-8") if file.exists() else ""
    found = differences(stored, said, exact=name in DECLARED)
    assert not found, f"{name} says something else than {file.name}:\n" + "\n".join(found)


def test_nothing_is_stored_that_is_not_played() -> None:
    assert {file.stem for file in SAID.iterdir()} == {Path(name).stem for name in (*VERBS, *SCRIPTS)}


_SENSELESS = re.compile(
    r"\b1 (recordings|joints|runs|causes|findings)\b|[\d]{7,} %|± ?[\d]{6,}|probability 1\.000"
)


def test_no_sentence_contradicts_its_numbers() -> None:
    """Read on strangers' pages: “1 recordings”, “100 ± 457441254189637 %”, “1.91 → 2.01, explains part”."""
    for file in SAID.iterdir():
        text = file.read_text(encoding="utf-8")
        assert (found := _SENSELESS.search(text)) is None, f"{file.name}: {found}"
        for before, after in re.findall(r"falls from ([\d.]+) to ([\d.]+) times", text):
            assert float(after) <= float(before), f"{file.name}: falls from {before} to {after}"


@pytest.mark.parametrize(
    ("stored", "said", "same"),
    [
        ("gain 97.6 % at 3.0000 N·m", "gain 97.6 % at 3.0001 N·m", True),
        ("gain 97.6 %", "gain 97.5 %", True),
        ("gain 97.6 %", "gain 97.3 %", False),
        ("31 causes", "32 causes", False),
        ("4480 samples", "4481 samples", True),
        ("value 1.2e-05", "value -1.2e-05", False),
        ("x\ny", "x", False),
        ("torque_ripple 0.5071 %, gain 0.95", "torque_ripple 0.5024 %, gain 0.95", True),
    ],
)
def test_a_number_may_differ_as_far_as_rounding_goes(stored: str, said: str, same: bool) -> None:
    assert (not differences(stored, said)) == same


def result(desk: Desk, name: str) -> dict[str, Any]:
    """Return the result file of a step."""
    desk.play(name)
    (file,) = (desk.folder / name).glob("*.json")
    return json.loads(file.read_text(encoding="utf-8"))


def test_the_unlumped_model_holds_on_held_out_torque_where_the_lumped_one_fails(desk: Desk) -> None:
    """The paper's point, at every sensor of every rig with a moving output."""
    for rig in result(desk, "paper")["moving_output"].values():
        assert rig["unlumped"] and all(sensor["explained"] > 0.95 for sensor in rig["unlumped"])
        assert min(sensor["explained"] for sensor in rig["lumped"]) < 0.5


def test_the_friction_of_the_record_is_found_with_its_size(desk: Desk) -> None:
    (cause,) = result(desk, "diagnosed")["causes"]
    torque = cause["parameters"]["torque"]
    assert cause["name"] == "coulomb_friction" and torque["ci95"][0] < 3.0 < torque["ci95"][1]
    low, high = cause["gain"]["holdout_ci95"]
    assert low <= cause["gain"]["holdout"] <= high


def test_the_design_is_the_papers_example(desk: Desk) -> None:
    asked = result(desk, "designed")["asked"]
    assert (round(asked["bandwidth_eq_7_hz"], 2), asked["largest_torque"]) == (55.83, 130.0)
    assert not asked["feasible"]
