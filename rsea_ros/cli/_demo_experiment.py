"""`rsea demo --experiment`: a bench with a hidden cause, a poor log, and runs designed one after another."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from rsea_ros.cli import demo
from rsea_ros.cli._lines import say
from rsea_ros.cli._processes import Processes
from rsea_ros.cli._runs import RIG
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.report import words

HIDDEN = (
    ("hard_stop", {"angle": 0.011, "stiffness": 5000.0}),
    ("current_loop_lag", {"time_constant": 0.003}),
    ("nonlinear_spring", {"cubic": 350.0}),
    ("ft_sensor_lag", {"time_constant": 0.0035}),
)
"""Causes that slow work does not reveal."""
LIMITS = "torque=25,velocity=2,deflection=0.04"
SLOW = {"kind": "chirp", "amplitude": 0.6, "noise": 0.0, "low": 0.15, "high": 0.4, "duration": 10.0}
SESSION = 150.0
"""s, longest duration of the session on a busy machine."""


def show(out: Path, domain: int, args: argparse.Namespace) -> int:
    """Hide a cause, record slow work, let the experiment node find the cause, and print what was hidden."""
    rig = load_rig(RIG)
    name, parameters = HIDDEN[int(np.random.default_rng(args.seed).integers(len(HIDDEN)))]
    true_rig = demo.drawn_rig(rig, args.seed).with_effect(name, **parameters)
    save_rig(true_rig, out / "bench.yaml")
    print(f"{RIG}, with values up to {100.0 * demo.SPREAD:g} % off and a cause known to the plant only")
    with Processes(out / "log", domain) as nodes:
        with demo.source(nodes, out, args) as first:
            log = _slow_work(nodes, out, first)
            _session(nodes, out, log)
        lines = nodes.log("experiment").read_text(encoding="utf-8").splitlines()
        nodes.stop(first)
    for line in lines:
        if "[INFO]" in line:
            say(line.partition("]: ")[2], indent=2)
    print(f"hidden cause: {hidden_cause_text(true_rig)}")
    return 0


def _slow_work(nodes: Processes, out: Path, first: str) -> Path:
    """Record the slow daily work of a bench, which reveals little; return the bag."""
    bag = out / "bag"
    with demo.stage(f"{first}, excite, record: 10 s of slow work at {SLOW['amplitude']:g} N·m") as tell:
        nodes.start("record", {"out": bag})
        nodes.start("excite", {**SLOW, "subscribers": 2})
        nodes.wait("excite", 10.0 + demo.START_UP, tell)
        nodes.stop("record")
    return bag


def _session(nodes: Processes, out: Path, bag: Path) -> None:
    """Run the experiment node; the demo consents to every run in advance."""
    with demo.stage(f"experiment: runs within {LIMITS}, without asking") as tell:
        values = {"bag": bag, "out": out, "limits": LIMITS, "ask": False, "rig": RIG}
        nodes.start("experiment", values)
        nodes.wait("experiment", SESSION, tell)


def hidden_cause_text(true_rig: Rig) -> str:
    """Return the hidden cause in words."""
    cause = true_rig.effects[-1]
    main = effect_named(cause.name).main
    size = f"{main.name.replace('_', ' ')} {cause.parameters[main.name]:g} {words.unit(main.unit)}"
    return f"{words.effect(cause.name)}, {size}"
