"""Simulate and diagnose a sample of a fleet's recordings, to measure what a recording shows of its joint.

python -m bench fleet trends_played --log out/played.jsonl [--minutes 3] [--write]

Each plan is a joint of test/independent with some wear, at some temperature, at some kind of normal work.
The log goes on where it stopped. --write puts the sample, without unneeded fields, beside this file; the
ten fleets of python -m bench fleet trends draw their recordings from it.
"""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from independent.bench import Bench
from independent.faults import FAULTS

from bench.fleet.plants import COULOMB, RIG, WORK, joint, recording
from bench.results import read_lines, resumed
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.errors import RseaError
from rsea_ros.library.diagnosed import diagnose
from rsea_ros.library.identified import identify
from rsea_ros.records.record import Record

SAMPLE = Path(__file__).with_name("trends_played.json")
TRIED = (
    "coulomb_friction", "backlash", "command_delay", "ft_gain_error", "torque_constant_error",
    "stribeck_friction", "ft_sensor_lag", "current_loop_lag", "gear_compliance", "load_dependent_friction",
)  # fmt: skip
"""Effects to try: the fleet's, and those easily confused with them. All would take an hour."""
WEAR: Mapping[str, Sequence[float]] = {
    "stiffness": (0.925, 0.85), "friction": (1.25, 1.5), "gap": (0.3e-3, 0.6e-3, 1.2e-3, 2.5e-3, 4.0e-3),
    "delay": (1.0e-3, 2.5e-3, 5.0e-3), "ft_gain": (0.95, 0.9),
}  # fmt: skip
SLIGHT: Mapping[str, Sequence[float]] = {
    "gap": (0.03e-3, 0.1e-3), "delay": (0.2e-3, 0.5e-3), "ft_gain": (0.98, 0.99),
}  # fmt: skip
"""Sizes of each wear, and those near the threshold of naming; two new joints beside each of the tables, on
which every cause is wrong."""
SPOILT = ("dropped_samples", "outliers", "frozen_samples")
"""Faults of recording that a joint of the fleet can have."""
TRUE = {
    "rotor.reflected_inertia": "j_m",
    "rotor.reflected_damping": "b_m",
    "spring.stiffness": "k_s",
    "spring.damping": "b_s",
}


@dataclass(frozen=True)
class Plan:
    """A recording to be made: the joint's seed and wear, kind of work, °C, fault of the data."""

    name: str
    seed: int
    kind: str
    temperature: float
    wear: Mapping[str, float] = field(default_factory=dict)
    fault: str = ""


def plans() -> Iterator[Plan]:
    """Yield the plans in an order in which every part of them is a fair sample."""
    states, slight = (
        [({}, ""), ({}, ""), *(({kind: size}, "") for kind, sizes in table.items() for size in sizes)]
        for table in (WEAR, SLIGHT)
    )
    states += [({}, fault) for fault in SPOILT]
    every = [(kind, *state) for part in (states, slight) for kind in WORK for state in part]
    for k in np.random.default_rng(16).permutation(len(every)):
        kind, wear, fault = every[k]
        rng = np.random.default_rng([16, int(k)])
        what = fault or " ".join(f"{n} {v:g}" for n, v in wear.items()) or "new"
        temperature = round(float(rng.uniform(15.0, 40.0)), 1)
        yield Plan(f"{k:02d} {kind} {what}", int(rng.integers(1, 2**31)), kind, temperature, wear, fault)


def record_run(plan: Plan) -> tuple[Bench, Record]:
    """Return the joint of a plan and its record."""
    bench = joint(plan.seed, temperature=plan.temperature, **plan.wear)
    record = recording(bench, plan.kind, plan.seed + 1)
    if plan.fault:
        record = FAULTS[plan.fault](record, np.random.default_rng(plan.seed + 2))
    return bench, record


def play(plan: Plan) -> dict[str, Any]:
    """Return the outcome of a plan beside the truth; a refusal is an outcome too.

    identified: of identify, which trusts the rig's structure; nothing if it refuses.
    """
    start = time.perf_counter()
    bench, record = record_run(plan)
    entry: dict[str, Any] = {**asdict(plan), "outcome": "done", "true": truth(bench), "identified": {}}
    others = tuple(name for name in catalogue() if name not in TRIED)
    try:
        entry |= summary_of(diagnose(record, RIG, settings=DiagnosisSettings(without=others)).result)
    except RseaError as error:
        entry |= {"outcome": "refused", "reason": str(error)}
    except Exception:
        entry |= {"outcome": "error", "reason": traceback.format_exc(limit=-3)}
    with suppress(RseaError):
        fit = identify(record, RIG).parameters
        entry["identified"] = {n: [p.value, *p.ci95, p.told_by_data] for n, p in fit.items() if n in TRUE}
    return dict(round_numbers(entry | {"seconds": round(time.perf_counter() - start, 1)}))


def truth(bench: Bench) -> dict[str, float]:
    """Return the joint's true values by the names of the rig and of the effects."""
    plant = bench.plant._asdict()
    values = {name: plant[alias] for name, alias in TRUE.items()}
    outside = {"ft_gain_error": bench.outside.ft_gain}
    return values | outside | {"coulomb_friction": bench.plant.coulomb, "backlash": bench.plant.gap,
                               "command_delay": bench.plant.delay}  # fmt: skip


def summary_of(d: Diagnosis) -> dict[str, Any]:
    """Return the result of a diagnosis, rounded: parameters, causes, faults, verdict."""
    parameters = {p.name: [p.value, *p.ci95, p.told_by_data] for p in d.final if p.name in TRUE}
    causes = [
        {
            "name": c.name,
            "status": c.status,
            "probability": c.probability,
            "gain": c.gain_holdout,
            "sizes": {n: [e.value, *e.ci95] for n, e in c.parameters.items()},
        }
        for c in d.causes
    ]
    share = max(r / d.noise_rms[n] for n, r in d.extended_residual_rms.items() if d.noise_rms.get(n))
    return {"verdict": d.verdict, "times_noise": share, "faults": sorted({f.kind for f in d.faults}),
            "parameters": parameters, "causes": causes}  # fmt: skip


def round_numbers(value: Any) -> Any:
    """Return a value of JSON with five significant digits in every number."""
    if isinstance(value, float):
        return float(f"{value:.5g}")
    if isinstance(value, dict):
        return {k: round_numbers(v) for k, v in value.items()}
    return [round_numbers(v) for v in value] if isinstance(value, list) else value


def main(*, log: Path, minutes: float = 3.0, write: bool = False) -> None:
    """Play the plans that the log does not hold yet.

    log: JSON lines, a recording each
    minutes: begin no recording after this time
    write: put the sample of the log beside this file
    """
    every = {plan.name: plan for plan in plans()}
    for entry in resumed(log, ((name, partial(play, plan)) for name, plan in every.items()), "name", minutes):
        names = ", ".join(c["name"] for c in entry.get("causes", []))
        print(f"{entry['name']:<34}{entry['seconds']:5.1f} s  {names}", flush=True)
    done = {entry["name"]: entry for entry in read_lines(log)}
    print(f"of {len(every)} recordings {len(done)} diagnosed and identified")
    print(f"healthy joints have {COULOMB:g} N·m of dry friction")
    if write:
        SAMPLE.write_text("[\n" + ",\n".join(json.dumps(done[n]) for n in every if n in done) + "\n]\n")
