"""Real machines: the residual after naming, its law, and the gain of the law on held-out data.

    python -m bench laws real emps --out out/laws-real      a diagnosis, then a law on its model
    python -m bench laws real --table --out out/laws-real    the machines that are done, as a table

Data: ../shared/realdata, beside the repository; origins and licences: CONTRIBUTING.md.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from bench import parser_of
from bench.public.fit import DATA, RIGS, record_of as benchmark_record
from bench.public.silverbox import ANGLE, RATE, TORQUE
from msg_adapters.tables import import_record, load_map
from rsea_ros.cli.maps import map_path
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.laws.learn import learn
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Record
from rsea_ros.report.law.page import write_law
from rsea_ros.report.law.words import headline, law_lines


def _table(file: str, name: str) -> Callable[[], Record]:
    return lambda: import_record(DATA / file, load_map(map_path(name)))


def _silverbox() -> Record:
    """Return 40 s of the training part."""
    import numpy as np

    u, y = np.genfromtxt(DATA / "silverbox" / "SNLS80mV.csv", delimiter=",", skip_header=1, usecols=(0, 1)).T
    part = slice(40650, 40650 + int(40 * RATE))
    record = benchmark_record(TORQUE * u[part], ANGLE * y[part], RATE)
    return record


CYCLOIDAL = "cycloidal/2024-07-18__10-58-26__torqueramp__base_onyx_runin1.csv.gz"
MACHINES: Mapping[str, tuple[Callable[[], Record], str | Path, bool]] = {
    "emps": (_table("emps/DATA_EMPS.mat", "emps_identification"), "emps", True),
    "silverbox": (_silverbox, RIGS / "silverbox.yaml", False),
    "cycloidal": (_table(CYCLOIDAL, "cycloidal_short_ramps"), "cycloidal", True),
    "sea_gamma": (_table("sea_gamma/open_3_1_25.csv", "sea_gamma"), "sea_two_encoders", True),
    "pendulum": (_table("pendulum/gravity_compensation.measured.csv.gz", "pendulum"), "pendulum", True),
}
"""Record, rig, and whether a diagnosis names causes first (the silverbox's rig states them)."""


def main(argv: Sequence[str]) -> int:
    """Play one machine, or print the table of those played."""
    parser = parser_of(__doc__)
    parser.add_argument("machine", nargs="?", choices=tuple(MACHINES))
    parser.add_argument("--out", type=Path, default=Path("out/laws-real"))
    parser.add_argument("--table", action="store_true", help="print what is done")
    args = parser.parse_args(argv)
    if args.table:
        print(table(args.out))
        return 0
    if args.machine is None:
        parser.error("expected a machine or --table")
    if not DATA.is_dir():
        print(f"{DATA}: no such folder, expected the measurements of real machines", file=sys.stderr)
        return 2
    read, rig_name, is_diagnosed = MACHINES[args.machine]
    record, rig = read(), load_rig(rig_name)
    named, rig = _name_causes(record, rig) if is_diagnosed else ([e.name for e in rig.effects], rig)
    result = learn([record], rig)
    write_law(result, args.out / args.machine)
    (args.out / args.machine / "named.json").write_text(json.dumps(named), encoding="utf-8")
    print(f"{args.machine}: named {', '.join(named) or 'nothing'}")
    print(headline(result), *law_lines(result), f"gain {100 * result.gain:.1f} %", sep="\n")
    return 0


def _name_causes(record: Record, rig: Rig) -> tuple[list[str], Rig]:
    """Return the causes that a diagnosis names, and the rig with them."""
    result = diagnose([record], rig)
    return [c.name for c in result.causes], replace(result.extended_rig, name=rig.name)


def table(folder: Path) -> str:
    """Return named causes, the law of the rest and its gain, a row for each machine."""
    rows = [
        "| machine | named before | what is left depends on | law | gain, held out (95 %) |",
        "|---|---|---|---|---|",
    ]
    for name in MACHINES:
        path = folder / name / "law.json"
        if not path.exists():
            continue
        law = json.loads(path.read_text(encoding="utf-8"))
        named = json.loads((folder / name / "named.json").read_text(encoding="utf-8"))
        equations = "; ".join(f"`{each['equation']}`" for each in law["laws"]) or "none"
        low, high = (100 * v for v in law["gain"]["holdout_ci95"])
        gain = f"{100 * law['gain']['holdout']:.0f} % ({low:.0f} to {high:.0f} %)" if law["laws"] else "–"
        rows.append(
            f"| {name} | {', '.join(named) or 'nothing'} | {law['sentence']} | {equations} | {gain} |"
        )
    return "\n".join(rows)
