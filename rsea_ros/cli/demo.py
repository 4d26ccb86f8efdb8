"""`rsea demo`: the whole loop without hardware."""

import argparse
import os
import random
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np

from msg_adapters import read_record
from msg_adapters.bags import read_contents
from rsea_ros.cli._options import RIG, path
from rsea_ros.cli._processes import Processes, need_ros, parameters_of_bench
from rsea_ros.cli._terminal import columns, progress, say, whole_number
from rsea_ros.documents import strict_yaml
from rsea_ros.documents.units import plain
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.hardware.peer.remote import RemoteBench
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.outputs.files import unused_path
from rsea_ros.report import words
from rsea_ros.report.remark_words import fault_lines

HELP = "excite, record, replay and identify a simulated bench on live ROS 2 nodes, and write a report"
EXAMPLE = "rsea demo --out first_demo"
NAMES = (
    "bag", "bag-2", "bench.yaml", "log", "identification.json", "experiment.json", "model.yaml", "report.html"
)  # fmt: skip
DISTURBANCES = {"commands_left_out", "late_commands", "lost_messages", "watchdog_trips"}
"""Faults of a bag after a delay of bench or excitation: commands did not act at their stamps."""
SHORT, FULL = 20.0, 160.0
SPREAD = 0.1
PACE = 10.0
EXCITED = {"slew_limit": 25_000.0, "effort_limit": 0.0}
"""The paper's excitation changes by 23 000 N m/s."""
START_UP = 60.0
"""s, allowed for a node in addition to its work: a cold start compiles the simulation."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--full", action="store_true", help="use the paper's 160 s of excitation instead of 20 s")
    add("--experiment", action="store_true", help="find a hidden cause by runs designed one after another")
    add("--wire", action="store_true", help="put the plant behind real wires and use the driver")
    add("--out", type=path, help="directory of the results (default out/demo-TIME)")
    seed = "seed of true values, excitation and noise (default 1)"
    add("--seed", type=whole_number, default=1, help=seed)
    add("--domain", type=int, help="ROS domain, 0 to 101 (default: a random one)")


def run(args: argparse.Namespace) -> int:
    need_ros()
    out = directory(args.out)
    domain = random.randint(1, 101) if args.domain is None else args.domain
    duration = FULL if args.full else SHORT
    out.mkdir(parents=True, exist_ok=True)
    if args.experiment:
        return show(out, domain, args)
    true_rig = drawn_rig(load_rig(RIG), args.seed)
    save_rig(true_rig, out / "bench.yaml")
    print(f"{RIG}, with true values up to {100.0 * SPREAD:g} % off, known to the plant only")
    with Processes(out / "log", domain) as nodes:
        bag = record_bench(nodes, out, duration, args)
        evaluate(nodes, bag, out, duration)
        print(table(load_rig(RIG), true_rig, load_rig(out / "model.yaml")))
        print(losses(bag, nodes.log("identify")))
    print(f"report: {out / 'report.html'}")
    return 0


def directory(out: Path | None) -> Path:
    """Return the directory of all results. Raises ParameterError if it already holds some of them."""
    if out is None:
        return unused_path(Path("out") / time.strftime("demo-%Y%m%d-%H%M%S"))
    for name in NAMES:
        if os.path.lexists(out / name):
            raise ParameterError(f"--out {out}: holds a {name} already, expected a new directory")
    return out


def record_bench(nodes: Processes, out: Path, duration: float, args: argparse.Namespace) -> Path:
    """Record the bench, a second time if this machine was too busy; return the bag."""
    for bag, consequence in (
        (out / "bag", "recording once more"),
        (out / "bag-2", "again; the results come from a disturbed run"),
    ):
        with source(nodes, out, args) as name:
            title = f"{name}, excite, record: chirp and noise for {duration:g} s"
            measure(nodes, bag, title, {"duration": duration, "seed": args.seed}, name)
        disturbances = [f for f in read_record(bag, strict=False).faults if f.kind in DISTURBANCES]
        if not disturbances:
            break
        say(f"this machine was too busy ({'; '.join(fault_lines(disturbances))}): {consequence}", indent=2)
    return bag


def drawn_rig(rig: Rig, seed: int) -> Rig:
    """Return a rig whose free values differ at random by up to SPREAD."""
    rng = np.random.default_rng(seed)
    return rig.with_values({n: rig[n] * (1.0 + SPREAD * rng.uniform(-1.0, 1.0)) for n in rig.free()})


@contextmanager
def stage(title: str) -> Iterator[Callable[[float], None]]:
    """Print the step that begins; the yielded function takes the share done, 0 to 1."""
    print(title, flush=True)
    with progress(title.partition(":")[0]) as tell:
        yield lambda share: tell("", share)


@contextmanager
def source(nodes: Processes, out: Path, args: argparse.Namespace) -> Iterator[str]:
    """Start the source of the measurements: the plant, or the driver with a bench on its wires."""
    rig = out / "bench.yaml"
    if not args.wire:
        nodes.start("plant", {"rig": rig, "seed": args.seed})
        yield "plant"
        return
    with RemoteBench(out / "tty", "--rig", rig, "--seed", args.seed) as bench:
        start = {"rig": RIG, "autostart": True, "resume": True}
        nodes.start("driver", {**bench.parameters(), **patience(), **EXCITED, **start})
        yield "driver"
    faults = [line for line in nodes.log("driver").read_text().splitlines() if "[ERROR]" in line]
    if faults:
        raise RseaError(f"driver: {faults[0].partition(']: ')[2]} (log: {nodes.log('driver')})")


def patience() -> Mapping[str, float]:
    """Return the parameters of a driver on the simulated bench, which answers later than hardware."""
    content = strict_yaml.read(parameters_of_bench()).content
    return cast(Mapping[str, float], content["/**"]["ros__parameters"])


def measure(nodes: Processes, bag: Path, title: str, command: Mapping[str, Any], *then_stop: str) -> None:
    """Play a command and record it. command: parameters of the node excite."""
    with stage(title) as tell:
        nodes.start("record", {"out": bag})
        nodes.start("excite", {**command, "subscribers": 2})
        nodes.wait("excite", command["duration"] + START_UP, tell)
        nodes.stop("record", *then_stop)


def evaluate(nodes: Processes, bag: Path, out: Path, duration: float) -> None:
    with stage(f"replay, identify: the bag at {PACE:g} times the speed") as tell:
        nodes.start("identify", {"rig": RIG, "out": out, "reliable": True})
        nodes.start("replay", {"bag": bag, "rate": PACE})
        nodes.wait("replay", duration / PACE + START_UP, tell)
    with stage("identify: parameters with confidence, report") as tell:
        nodes.wait("identify", START_UP, tell)


def table(start: Rig, true: Rig, identified: Rig) -> str:
    """Return identified values with their 95 % interval beside the true ones, as text."""
    rows = [("", "true", "identified", "95 % interval", "start", "unit")]
    for name in start.free():
        quantity = identified.quantities[name]
        low, high = quantity.ci95 or (float("nan"), float("nan"))
        interval = f"{low:.5g} to {high:.5g}"
        values = f"{true[name]:.5g}", f"{quantity.value:.5g}", interval, f"{start[name]:.5g}"
        rows.append((name, *values, plain(identified.unit(name))))
    return columns(rows)


def losses(bag: Path, identify_log: Path) -> str:
    """Return how many messages of the bag reached the identification."""
    wanted = ("torque_command", "joint_states", "ft")
    topics = read_contents(bag).topics
    sent = sum(len(topics[f"/rsea/{name}"].raw) for name in wanted)
    log = identify_log.read_text()
    got = [re.findall(rf"(\d+) {name}\b", log) for name in wanted]
    arrived = sum(int(counts[-1]) for counts in got if counts)
    return f"{sent} messages recorded and replayed, {sent - arrived} lost"


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
    true_rig = drawn_rig(rig, args.seed).with_effect(name, **parameters)
    save_rig(true_rig, out / "bench.yaml")
    print(f"{RIG}, with values up to {100.0 * SPREAD:g} % off and a cause known to the plant only")
    with Processes(out / "log", domain) as nodes:
        with source(nodes, out, args) as first:
            title = f"{first}, excite, record: 10 s of slow work at {SLOW['amplitude']:g} N·m"
            measure(nodes, out / "bag", title, SLOW)
            with stage(f"experiment: runs within {LIMITS}, without asking") as tell:
                values = {"bag": out / "bag", "out": out, "limits": LIMITS, "ask": False, "rig": RIG}
                nodes.start("experiment", values)
                nodes.wait("experiment", SESSION, tell)
        lines = nodes.log("experiment").read_text(encoding="utf-8").splitlines()
        nodes.stop(first)
    for line in lines:
        if "[INFO]" in line:
            say(line.partition("]: ")[2], indent=2)
    print(f"hidden cause: {hidden_cause_text(true_rig)}")
    return 0


def hidden_cause_text(true_rig: Rig) -> str:
    cause = true_rig.effects[-1]
    main = effect_named(cause.name).main
    size = f"{main.name.replace('_', ' ')} {cause.parameters[main.name]:g} {words.unit(main.unit)}"
    return f"{words.effect(cause.name)}, {size}"
