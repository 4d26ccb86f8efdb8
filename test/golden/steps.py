"""What is played, by the name of what it writes; a later step reads what an earlier one wrote."""

import argparse
import importlib
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import astuple
from io import StringIO
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from fleet_histories import cause, history, recordings
from written import rounded, short, sums, text_of

import rsea_ros as rsea
from rsea_extras.pages.page import write_fleet_report
from rsea_ros.cli.export import exporter
from rsea_ros.cli.main import verbs
from rsea_ros.diagnosis.settings import DEFAULT
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.effects.effect import Claims
from rsea_ros.errors import RseaError
from rsea_ros.exports.others import coverage_lines
from rsea_ros.laws import terms
from rsea_ros.laws.effect_source import LawProvenance, source_of
from rsea_ros.laws.law import FittedTerm, Law, LearntCurve
from rsea_ros.model.rig_file import packaged_names, rig_text
from rsea_ros.nodes.joint import KINDS

RIG = "paper_high_impedance"
PLAY = ("backlash", "hard_stop", "ft_sensor_lag", "coulomb_friction")
NO_PLAY = " ".join(n for n in catalogue() if n not in PLAY)

VERBS: dict[str, tuple[str, ...]] = {
    "bag": (f"simulate {RIG} --effect coulomb_friction:torque=3 --duration 6 --seed 5 --out bag",),
    "check": ("check bag", "check bag --json"),
    "identified": ("identify bag --out identified",),
    "diagnosed": ("diagnose bag --out diagnosed",),
    "predicted.csv": ("predict diagnosed/model.yaml bag --out predicted.csv",),
    "law": ("law bag --out law --from 1",),
    "run": (
        "experiment play.yaml drag.yaml --limits torque=40,deflection=0.1 --longest 2 --refine 8 --out run",
    ),
    "designed": ("design --out designed",),
    "controlled": (f"control {RIG} --rate 75 --out controlled",),
    "paper": ("paper --duration 20 --out paper",),
    "exported": tuple(
        f"export --{kind} diagnosed/model.yaml --out exported{name}{' --json' * (kind == 'sdf')}"
        for kind, name in zip(
            ("mjcf", "urdf", "sdf", "fmu", "isaac", "bam", "feedforward"),
            ("0.mjcf", "1.urdf", "2.sdf", "3.fmu", "4.isaac", "5.bam", "6.h"), strict=True,
        )
    ),
    "lists": ("--help", "rigs", "maps", "effects"),
    "effects": tuple(f"effects {name}" for name in catalogue()),
    "rigs": ("rig new mine", *(f"rig check {name}" for name in packaged_names())),
    "imported": ("import spoiled.csv --map map.yaml --out imported",),
    "spoiled": ("check imported --rig pendulum", "check imported"),
    "spoiled_diagnosis": (f"diagnose imported --json --max-causes 1 --from 0.5 --without {NO_PLAY}",),
    "fleet": (
        "fleet run right left --map joints.yaml --serial --out months",
        "fleet run right left --map joints.yaml --serial --out months",
        "fleet sql SELECT+joint,verdict,residual,faults+FROM+recordings+ORDER+BY+joint --store months",
        "fleet sql SELECT+parameter,value,low,high+FROM+parameters+ORDER+BY+value --store months --json",
        "fleet report months --out fleet",
    ),
    "benchmark": (
        "benchmark make records --records 3 --duration 6",
        "benchmark score records answers.jsonl",
    ),
    "refused": (
        "dance", "idntify", "check nowhere", "identify bag --rig nowhere", "identify bag --what",
        "diagnose bag --holdout bag", "diagnose bag --without dance", "diagnose bag --from 5 --to 3",
        "diagnose bag --max-causes none", "diagnose bag --fail-on dance", "identify bag --topic ft=/nowhere",
        "identify bag --axis torqe.z", "identify bag --shift ft=much", "check bag --joint elbow",
        "check bag --window 3", "predict map.yaml bag", "predict bag", "law bag --from 5.9",
        f"simulate {RIG} --effect dance:torque=1 --out x", f"simulate {RIG} --effect backlash:gap=-1 --out x",
        f"simulate {RIG} --effect backlash:gap=wide --out x", f"simulate {RIG} --duration 0 --out x",
        f"simulate {RIG} --rate 1e9 --out x", f"simulate {RIG} --low 200 --out x",
        f"simulate {RIG} --out bag",
        f"experiment {RIG} --limits torque=-1 --bag bag",
        f"experiment {RIG} --limits torqe=40", "design --torque -5", "design --unit rd85",
        "control bare_drive",
        f"control {RIG} --rate 3", f"control {RIG} --rate 10000", f"control --free {RIG}",
        "export --fmu nowhere",
        "effects backlsh", "rig check map.yaml", "rig new a/b", "import map.yaml --map map.yaml --out x",
        "import spoiled.csv --map pendulum --out x", "import spoiled.csv --map nowhere --out x",
        "import nowhere.csv --map map.yaml --out x", "fleet run nowhere --map joints.yaml --out s",
        "fleet run bag --map map.yaml --out s", "fleet report nowhere", "fleet sql SELECT --store nowhere",
        "benchmark make x --records 0", "benchmark score nowhere nowhere", "paper --duration 1",
        "run nowhere", "launch nowhere", "check bag bag --fail-on amber",
        *(
            f"simulate {RIG} --out x --effect {senseless}"
            for senseless in (
                "backlash:gap=0.2", "backlash:gap=nan", "backlash:gap=0x10", "backlash:gap=1_0",
                "backlash:gap", "backlash:gap=1:30", "backlash:gap=1e-3,gap=2e-3",
                "backlash --effect backlash", "backlash:width=1",
            )
        ),
        # names that are nearly right are answered with the right one
        "idenfity", "excite", "--verson", "run plnt", "launch simulaton", "launch replay bagg:=x",
        "topics eco", "rig nwe x", "export --mjcff x", "control paper_hi", "import x --map pendulm --out y",
        "diagnose bag --holdut y", "identify bag --rig paper_hih_impedance",
        "identify bag --topic joint_state=/x", f"simulate {RIG} --effect colomb_friction:torque=1 --out x",
        f"simulate {RIG} --efect backlash:gap=0.004 --out x", "import a.csv --map so11 --out x",
    ),
}  # fmt: skip
"""Lines of the command line, in their order."""

INPUTS: dict[str, str | Callable[[], str]] = {
    "map.yaml": """about: a bench with play, whose recorder lost samples
time: {column: t, unit: s}
channels:
  command: {column: u, unit: N m}
  position: {column: phi, unit: deg}
  velocity: {column: omega, unit: rad/s, scale: 1.0}
  ft: {expression: "tau * 0.98", unit: N m}
""",
    "joints.yaml": """defaults:
  rig: paper_high_impedance
  diagnose: never
joints:
  left: {bags: left}
  right: {bags: right}
""",
    "answers.jsonl": "\n".join(
        f'{{"record": "r000{k}", "causes": [{{"name": "{name}", "probability": 0.7}}], "seconds": 2.0}}'
        for k, name in enumerate(("backlash", "coulomb_friction", "ft_bias"), 1)
    ),
    "spoiled.csv": lambda: spoiled(),
    "play.yaml": lambda: rig_text(rsea.load_rig(RIG).with_effect("backlash", gap=0.004)),
    "drag.yaml": lambda: rig_text(rsea.load_rig(RIG).with_effect("coulomb_friction", torque=2.0)),
    "left": f"simulate {RIG} --duration 5 --seed 2 --out left",
    "right": f"simulate {RIG} --effect coulomb_friction:torque=3 --duration 5 --seed 5 --out right",
}
"""Files that steps read: their text, or the line that makes them."""


def commands(seconds: float, seed: int) -> np.ndarray:
    """Return steps and noise, N m."""
    rng = np.random.default_rng(seed)
    n = round(280 * seconds)
    return 6.0 * rng.standard_normal(n) + 12.0 * np.sign(np.sin(2 * np.pi * 0.7 * np.arange(n) / 280.0))


def spoiled() -> str:
    """Return a table of a bench with play and a late F/T sensor: frozen, missing, wild and lost samples."""
    u = commands(9.0, 4)
    rig = rsea.load_rig(RIG).with_values({"spring.stiffness": 1500.0})
    rig = rig.with_effect("backlash", gap=0.006).with_effect("ft_sensor_lag", time_constant=0.004)
    record = rsea.simulate(rig, u, 280.0, seed=8)
    t, ft = record["ft"].t.copy(), record["ft"].y.copy()
    ft[500:560] = ft[500]
    ft[[900, 1400, 1700]] += 400.0
    ft[1200:1205] = np.nan
    rows = zip(t, u, np.degrees(record["position"].y), record["velocity"].y, ft, strict=True)
    lost = {*range(2000, 2030), 2300}
    lines = [",".join(f"{x:.9g}" for x in row) for k, row in enumerate(rows) if k not in lost]
    return "t,u,phi,omega,tau\n" + "\n".join(lines) + "\n"


def effects_in_motion(folder: Path) -> Iterator[str]:
    """Yield what each effect of its typical size does to each channel of each kind of rig."""
    u = commands(3.0, 6)
    for rig in (RIG, "pendulum", "bare_drive", "two_moving_outputs"):
        yield f"{rig}: " + _channels(rsea.simulate(rig, u, 280.0, seed=1))
    for name in catalogue():
        rig = rsea.load_rig("pendulum" if name == "gravity_error" else RIG)
        yield f"{name}: " + _channels(rsea.simulate(rig.with_effect(name), u, 280.0, noise=False))


def _channels(record: rsea.Record) -> str:
    return "; ".join(f"{n} {sums(c.y)}" for n, c in record.channels.items())


def observed(folder: Path) -> Iterator[str]:
    """Yield the estimates of the observer and the commands of the controller on a record."""
    u = commands(4.0, 9)
    rig = rsea.load_rig(RIG)
    record = rsea.simulate(rig.with_effect("ft_bias", bias=2.0), u, 280.0, seed=3)
    observer = rsea.Observer(rig)
    rows = []
    for k, t in enumerate(record["ft"].t):
        observer.command(t, u[k])
        observer.state(t, record["position"].y[k], record["motor_torque"].y[k])
        rows.append(observer.ft(t, record["ft"].y[k]))
    for name, column in zip(rows[0]._fields, np.transpose(rows), strict=True):
        yield f"observer {name}: {sums(column)}"


def worn_fleet(folder: Path) -> Iterator[str]:
    """Yield the pages of a fleet of which one joint wears and one has play from a day on."""
    rng, joints = np.random.default_rng(3), ("hip", "knee <left>", "elbow")
    made = history(
        rng, joints=joints, days=60, course=lambda j, d: -2e-3 * np.clip(d - 25, 0, None) * (j == joints[1])
    )
    made["identifiable"] &= made["joint"] != "elbow"
    told = recordings(
        joints, 60, causes=lambda j, d: [cause("backlash", 2e-3)] if j == "hip" and d >= 30 else [],
        faults=lambda j, d: [{"kind": "outliers", "count": 3, "detail": ""}] if d == 7 else [],
    )  # fmt: skip
    pages = write_fleet_report(made, told, folder / "pages").parent
    yield from (text_of(pages / name) for name in ("index.html", "joint-knee--left-.html"))


def few_days(folder: Path) -> Iterator[str]:
    """Yield the headings and notes of fleets with too few recordings, without dates, with a lasting cause."""
    both, five = ("hip", "rail"), ("hip", "knee", "ankle", "elbow", "wrist")
    play, alike = cause("backlash", 4e-3), cause("backlash", 4e-3, status="one_of", probability=0.7)
    undated = recordings(both, 3, causes=lambda j, d: [play])
    undated["time_s"] = np.where(undated["joint"] == "rail", np.nan, undated["time_s"])

    def made(joints: tuple[str, ...], days: int, **changes: Any) -> Any:
        return history(np.random.default_rng(1), joints=joints, days=days, **changes)

    def growing(joint: str, day: int) -> list[Any]:
        return [cause("coulomb_friction", 0.2 + 0.02 * max(0, day - 20), "torque", "N m")] * (joint == "hip")

    dateless = made(both, 3)
    dateless["time_s"] = np.where(dateless["joint"] == "rail", np.nan, dateless["time_s"])
    calm = made(five[:3], 40, each=1, sd=1e-6, day_sd=1e-6, parameter="rotor.reflected_damping")
    fleets = {
        "one of two": (made(both, 2), recordings(both, 2, causes=lambda j, d: [play] * (j == "rail" and d))),
        "many": (made(five, 2), recordings(five, 2, causes=lambda j, d: [play] * (j != "hip"))),
        "a few days": (made(("hip",), 3), recordings(("hip",), 3)),
        "no date": (dateless, undated),
        "from the first day on": (calm, recordings(five[:3], 40, causes=growing)),
        "look-alike": (made(five[:3], 30, each=1), recordings(five[:3], 30, causes=lambda j, d: [alike])),
    }
    seen = set[str]()
    for number, (name, (values, told)) in enumerate(fleets.items()):
        index = write_fleet_report(values, told, folder / f"few{number}")
        for page in (index, index.parent / "joint-hip.html"):
            lines = text_of(page).splitlines()
            yield f"{name}, {page.stem}:"
            yield from (x for x in lines if x.startswith(("<h", "<p", "<tr", "<li")) and x not in seen)
            seen |= set(lines)


def helps(folder: Path) -> Iterator[str]:
    """Yield the options of every verb, without the layout of argparse; what several share, once."""
    seen = set[str]()
    for name, module in verbs().items():
        verb = importlib.import_module(module)
        parser = argparse.ArgumentParser(prog=name)
        verb.add_arguments(parser)
        yield f"{name}: {verb.HELP} | {verb.EXAMPLE}"
        yield from (line for line in _options(parser, "  ") if line not in seen)
        seen |= set(_options(parser, "  "))


def nodes(folder: Path) -> Iterator[str]:
    """Yield what every node prints with --help: its parameters with their ranges and defaults."""
    for name, module in KINDS.items():
        node = importlib.import_module(module)
        sys.argv = [name, "--help"]
        with redirect_stdout(StringIO()) as out:
            assert node.main() == 0
        yield out.getvalue()


def exports(folder: Path) -> Iterator[str]:
    """Yield what each target makes of every kind of rig and effect, a line that came before not again."""
    base = rsea.load_rig("paper_moving_output")
    rigs = {name: rsea.load_rig(name) for name in packaged_names()}
    for name in catalogue():
        rigs[name] = (rigs["pendulum"] if name == "gravity_error" else base).with_effect(name)
    for target in ("mjcf", "urdf", "sdf", "isaac", "bam", "feedforward"):
        export = exporter(target)
        seen = set[str]()
        for name, rig in rigs.items():
            try:
                made = export(rig)
            except RseaError as error:
                yield f"{target} of {name}: {error}"
                continue
            texts = made.content.values() if isinstance(made.content, dict) else [made.content]
            lines = rounded("\n".join([*texts, *coverage_lines(made.says, made.leaves_out)])).splitlines()
            lines = [line.strip() for line in lines if not re.match(r"-?\d[^,]*,", line)]  # no tables
            new = [line for line in lines if line not in seen]
            seen |= set(new)
            yield "\n  ".join([f"{target} of {name}:", *new])


def terms_of_laws(folder: Path) -> Iterator[str]:
    """Yield what is listed in code: the terms that laws are made of."""
    waves = (*terms.wave_terms(7.0), *terms.waves("hip_", "load", "the hip", "N m", 1.0, "q"))
    found = (*terms.hum_terms(50.0), *terms.mode_terms((20.0,)), *waves)
    listed = (terms.GEAR_TERMS, terms.COMMAND_TERMS, terms.SPRING_TERMS, terms.SENSOR_TERMS, terms.LOAD_TERMS,
              terms.ENCODER_TERMS, found)  # fmt: skip
    for term in chain.from_iterable(listed):
        yield " | ".join(str(v) for v in (*astuple(term), term.remembers))


def written_laws(folder: Path) -> Iterator[str]:
    """Yield the file of each term, of a curve over each variable and place, and of a law of two terms."""
    ranges = {"w": 0.6, "q": 0.02, "h": 0.3, "theta": 10.0, "d": 0.02, "T": 30.0, "u": 24.0}
    listed = (terms.GEAR_TERMS, terms.COMMAND_TERMS, terms.MOTOR_TERMS, terms.SPRING_TERMS,
              terms.SENSOR_TERMS, terms.LOAD_TERMS, terms.ENCODER_TERMS, terms.wave_terms(7.0),
              terms.hum_terms(50.0), terms.mode_terms((20.0,)))  # fmt: skip
    fitted = [FittedTerm(term, 1.5, 0.25 if term.shape else 0.0) for term in chain.from_iterable(listed)]
    laws = [Law(f"law_{p.term.name}", p.term.place, p.term.regressor, (p,), ranges) for p in fitted]
    past = [p for p in fitted if p.term.memory and p.term.place == "spring"]
    laws.append(Law("law_of_two", "spring", "past", (past[0], past[-1]), ranges))
    x = np.linspace(-0.5, 0.5, 5)
    laws += [
        Law(f"curve_of_{letter}_{place}", place, "x", (), ranges, LearntCurve(letter, factor, x, 2.0 * x**3))
        for place in ("gear", "motor", "command", "spring", "ft", "load", "encoder")
        for letter, factor in (("w", ""), ("T", ""), ("u", "w"))
    ]
    claims, where = Claims("velocity", "neither", None), LawProvenance("DAY", "0", {"a.mcap": "ab"}, "Gain.")
    seen = set[str]()
    for law in laws:
        lines = source_of(law, claims, where).splitlines()
        new = [line for line in lines if line not in seen or line.startswith(("    s[", "    torque"))]
        seen |= set(new)
        yield "\n".join([f"{law.name} at {law.place}:", *new])


def settings(folder: Path) -> Iterator[str]:
    """Yield every number that steers a verdict, with its meaning, unit and reason."""
    for setting in DEFAULT.numbers():
        yield " | ".join(str(v) for v in setting)


def _options(parser: argparse.ArgumentParser, indent: str) -> Iterator[str]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, sub in action.choices.items():
                yield f"{indent}{name}:"
                yield from _options(sub, indent + "  ")
        elif not isinstance(action, argparse._HelpAction):
            default = short(action.default) if isinstance(action.default, float) else action.default
            choices = "" if action.choices is None else f" of {list(action.choices)}"
            called = " ".join(action.option_strings) or action.dest
            required = " required" * action.required
            kind = type(action).__name__.strip("_").removesuffix("Action")
            kind += f" {action.nargs} {default}{choices}{required}"
            yield f"{indent}{called} {action.metavar}: {kind} | {action.help}"


SCRIPTS: dict[str, Callable[[Path], Iterator[str]]] = {
    "effects_in_motion": effects_in_motion, "observed": observed, "worn_fleet": worn_fleet,
    "few_days": few_days, "helps": helps, "nodes": nodes,
    "terms_of_laws": terms_of_laws, "settings": settings, "exports": exports,
    "written_laws": written_laws,
}  # fmt: skip
"""What no line of the command line shows."""

DECLARED = {"lists", "effects", "helps", "nodes", "terms_of_laws", "settings"}
"""Steps that show what is declared: 0.015 for 0.01 is no rounding there."""
