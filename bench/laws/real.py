"""Real machines: the residual after naming, its law, and the gain of the law on held-out data.

    python -m bench laws real --only emps --log out/laws-real.jsonl

Records of ../shared/realdata that have a map and a rig in the library, and the silverbox, whose rig states
its causes; origins and licences: CONTRIBUTING.md. Named before: by a diagnosis.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.diagnosis.played import Entry, Played
from bench.frozen.cases import real_records
from bench.public.fit import DATA, RIGS, record_of
from bench.public.silverbox import ANGLE, RATE, TORQUE
from bench.results import read_lines, resumed
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.laws.law import equation_of
from rsea_ros.laws.learn import learn
from rsea_ros.model.rig_file import load_rig
from rsea_ros.report.law import headline


def main(*, log: Path, only: str = "", minutes: float = 60.0) -> None:
    """Play the machines that the log lacks, and print the table.

    log: JSON lines, a record each
    only: those with this text in their names
    minutes: begin no record after that
    """
    chosen = [e for e in _records() if only in e.name]
    for row in resumed(log, ((e.name, partial(_row, e)) for e in chosen), "machine", minutes):
        print(row["machine"], flush=True)
    print("| machine | named before | what is left depends on | law | gain, held out (95 %) |")
    print("|---|---|---|---|---|")
    for row in read_lines(log):
        print(f"| {row['machine']} | {row['named']} | {row['sentence']} | {row['law']} | {row['gain']} |")


def _records() -> Iterator[Entry]:
    if (DATA / "silverbox").exists():
        yield Entry("silverbox", _silverbox)
    if DATA.exists():
        yield from real_records()


def _silverbox() -> Played:
    """Return 40 s of the training part."""
    u, y = np.genfromtxt(DATA / "silverbox" / "SNLS80mV.csv", delimiter=",", skip_header=1, usecols=(0, 1)).T
    part = slice(40650, 40650 + int(40 * RATE))
    return Played(record_of(TORQUE * u[part], ANGLE * y[part], RATE), load_rig(RIGS / "silverbox.yaml"))


def _row(entry: Entry) -> dict[str, Any]:
    """Return named causes, the law of the rest and its gain."""
    played = entry.make()
    rig, named = played.rig, [e.name for e in played.rig.effects]
    if entry.name != "silverbox":
        diagnosis = diagnose([played.record], rig)
        rig, named = replace(diagnosis.extended_rig, name=rig.name), [c.name for c in diagnosis.causes]
    result = learn([played.record], rig)
    low, high = (100.0 * v for v in result.gain_ci95)
    gain = f"{100.0 * result.gain:.0f} % ({low:.0f} to {high:.0f} %)" if result.laws else "–"
    law = "; ".join(f"`{equation_of(w.law)}`" for w in result.laws) or "none"
    sentence, before = headline(result), ", ".join(named) or "nothing"
    return {"machine": entry.name, "named": before, "sentence": sentence, "law": law, "gain": gain}
