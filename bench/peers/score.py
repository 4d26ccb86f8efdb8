"""Peers on the same records: each in its own environment, the same blocks, the same budget of processor time.

Runs every peer that has an environment (ENVS/NAME, PINS says with what) on every case and prints the table;
results stay in OUT, and only missing ones are run again. What is compared, with
which settings, and who is at home where: docs/peers.md.
"""

import json
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from bench.peers.cases import REAL, SIMULATED, PeerRecord
from bench.results import Row

HERE = Path(__file__).resolve().parent
PINS = {
    "mujoco_sysid": "mujoco[sysid]==4.0.0 scipy==1.16.3",
    "bam": "cma==4.5.0 numba==0.68.1 scipy==1.17.1",
    "cma_pace": "cma==4.5.0 numba==0.68.1 scipy==1.17.1",
}
"""By peer: the versions that were compared, for who makes its environment; nothing here installs them."""
PEERS = {"rsea": "with_rsea", "mujoco_sysid": "with_mujoco_sysid", "bam": "joints", "cma_pace": "joints"}
"""By peer: the module with a function of its name."""
PATIENCE = 8.0
"""Times the budget: wall seconds after which a peer is stopped; the machine may be busy with others."""
DIVERGED = -1000.0
"""Fit, %, below which a free run is said to diverge."""


def main(
    *, peers: Annotated[tuple[str, ...], PEERS] = tuple(PEERS), cases: tuple[str, ...] = (),
    realdata: Path | None = None, budget: float = 20.0, envs: Path = Path("out/peers/envs"),
    out: Path = Path("out/peers"),
) -> Iterator[Row]:  # fmt: skip
    """Run what is missing, and print the table.

    cases: names of cases, all where none is named
    realdata: folder with emps; without it that case is left out
    budget: processor seconds for a fit; 0: run nothing, print the results so far
    envs: environments
    out: cases and results
    """
    made = [make() for make in SIMULATED] + [make(realdata) for make in REAL if realdata]
    out.mkdir(parents=True, exist_ok=True)
    for case in (c for c in made if not cases or c.name in cases):
        for peer in peers:
            yield _row(peer, case, _result(peer, case, out, envs, budget))


def _result(peer: str, case: PeerRecord, out: Path, envs: Path, budget: float) -> dict[str, Any]:
    """Return the result of a peer, from its file if there is one."""
    stem = f"{case.name.replace(' ', '_').replace(',', '').replace(chr(39), '')}"
    target = out / f"{stem}.{peer}.json"
    if target.exists():
        return dict(json.loads(target.read_text(encoding="utf-8")))
    python, reason = _python(peer, envs)
    if reason or not budget:
        return {"not_run": reason or "not yet"}
    source = out / f"{stem}.npz"
    np.savez(source, meta=json.dumps(case.meta), **case.arrays)  # type: ignore[arg-type]
    command = [python, HERE / "common.py", f"{PEERS[peer]}:{peer}", source, target, str(budget)]
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    try:
        done = subprocess.run(
            list(map(str, command)), env={**os.environ, **one_thread}, timeout=PATIENCE * budget,
            capture_output=True, text=True, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return {"not_run": f"stopped after {PATIENCE * budget:g} s"}
    if not target.exists():
        lines = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
        return {"not_run": lines[-1][:120]}
    return dict(json.loads(target.read_text(encoding="utf-8")))


def _python(peer: str, envs: Path) -> tuple[Path, str]:
    """Return the interpreter of a peer's environment, or why there is none."""
    python = Path(sys.executable) if peer == "rsea" else (envs / peer / "bin" / "python").absolute()
    return python, "" if python.exists() else f"no environment {envs / peer}, expected one with {PINS[peer]}"


def _row(peer: str, case: PeerRecord, result: dict[str, Any]) -> Row:
    columns = ("residual / noise", "fit, %", "values off, %", "cause", "s", "note")
    if "not_run" in result:
        texts = (f"not run: {_cell(result['not_run'])}", *[""] * 5)
    else:
        error = np.array(result["prediction"]) - case.y[case.split :]
        rms = float(np.sqrt(np.mean(error**2)))
        fit = 100.0 * (1.0 - rms / float(case.y[case.split :].std()))
        texts = (
            _number(rms / case.noise), _number(fit) if fit > DIVERGED else "diverges",
            _number(_values_off(case, result)), _cell(result["cause"] or "none named"),
            f"{result['seconds']:.1f}", _cell(result["note"]),
        )  # fmt: skip
    return Row(case.name, "", {"peer": peer, **dict(zip(columns, texts, strict=True))})


def _values_off(case: PeerRecord, result: dict[str, Any]) -> float:
    """Return the RMS relative error of the true values that a peer states, %; not a number for none."""
    pairs = [(result["parameters"][n], v) for n, v in case.truth.items() if n in result["parameters"]]
    errors = [float(value) / true - 1.0 for value, true in pairs]
    return 100.0 * math.sqrt(sum(e**2 for e in errors) / len(errors)) if errors else math.nan


def _number(value: float) -> str:
    if not math.isfinite(value):
        return "–"
    return f"{value:.3g}" if not 1e3 <= abs(value) < 1e6 else f"{value:.0f}"


def _cell(text: str) -> str:
    return " ".join(str(text).replace("|", "/").split())
