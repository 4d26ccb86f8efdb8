"""What the package declares, and what its small functions return: numbers and words that no verb may show.

It does not say that a number is right, only that it has changed: the difference belongs into the commit.
"""

from __future__ import annotations

import ast
import enum
import importlib
import inspect
import re
import sys
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import CodeType, FrameType, ModuleType
from typing import Any

import numpy as np
from fleet_histories import cause, history, recordings
from written import short

import rsea_ros as rsea
from rsea_ros.control import synthesis
from rsea_ros.control.law import Gains
from rsea_ros.control.loads import load_range
from rsea_ros.design.motor_gear_units import unit_named
from rsea_ros.design.requirement import Requirement
from rsea_ros.design.spring_design import spring_design
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue, effect_named
from rsea_ros.errors import RseaError
from rsea_ros.records.record import Channel
from rsea_ros.report.design.page import design_report
from rsea_ros.report.diagnosis.page import diagnosis_report
from rsea_ros.report.identification.page import identification_report
from rsea_ros.trends.fleet_trends import fleet_trends

PACKAGE = Path(rsea.__file__).parent
PURE = re.compile(
    r"(benchmark\.scoring|checks|control|design|diagnosis|documents|effects|experiment|exports|health|laws"
    r"|identification|model|paper|records|report|trends"
    r"|hardware\.(dynamixel\.(control_tables|frames)|netft\.rdt|peer\.protocol2|limits))(\.|$)"
)
"""Modules whose functions may be called with anything: they write nothing and wait for nothing."""
LEFT_OUT = re.compile(
    r".*\.(largest_gain|with_check_faults|ours|play_mujoco|_fit|bands|sample|effect_from|run|limits|_simulate"
    r"|alternative_of|_against_rig|_fold|inverse_of|robust_stiffness|pairs_of|_complete|by_train|_with_train"
    r"|figure_15|faults\.check|least_\w+|stiffness_bounds|overlay_records|_parts|_matched)$"
)
"""Functions that take over 0.1 s, name a temporary folder, return an address or hang on the last digit."""
LONG, WHOLE, CALLS = 40, 3000, 700
"""Characters of a text and of a constant from which on a check sum stands for them, and of calls."""
RIGS = ("paper_high_impedance", "pendulum", "two_moving_outputs", "pd_joint")
EFFECTS = ("coulomb_friction", "backlash", "ft_sensor_lag", "mains_interference", "structural_resonance")

JOINTS = ("hip", "knee", "elbow")


def modules() -> Iterator[tuple[str, ModuleType]]:
    """Yield name and module of all but the programs."""
    for file in sorted(PACKAGE.rglob("*.py")):
        name = ".".join(file.relative_to(PACKAGE).with_suffix("").parts)
        if not name.endswith("__"):
            yield name, importlib.import_module(f"rsea_ros.{name}")


def constants(folder: Path) -> Iterator[str]:
    """Yield a line for each constant, each function with defaults and each class with fields."""
    for place, module in modules():
        for name in _assigned(module):
            yield f"{place}.{name} = {_cut(told(vars(module).get(name)), WHOLE)}"
        for name, value in vars(module).items():
            if getattr(value, "__module__", "") == module.__name__ and (said := ", ".join(_defaults(value))):
                yield f"{place}.{name}: {said}"


def _assigned(module: ModuleType) -> Iterator[str]:
    for node in ast.parse(Path(str(module.__file__)).read_text(encoding="utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", node)]
        yield from (t.id for t in targets if isinstance(t, ast.Name))
        yield from (n.id for t in targets if isinstance(t, ast.Tuple) for n in t.elts)  # type: ignore


def _defaults(value: Any) -> Iterator[str]:
    """Yield the defaults of a function, or of a class and its methods."""
    if not inspect.isclass(value):
        value = getattr(value, "py_func", value)
        named = inspect.signature(value).parameters.values() if inspect.isfunction(value) else ()
        yield from (f"{p.name} {told(p.default)}" for p in named if p.default is not p.empty)
        return
    for field in fields(value) if is_dataclass(value) else ():
        default = field.default
        if field.default_factory is not MISSING:
            default, again = field.default_factory(), field.default_factory()
            default = default if told(default) == told(again) else MISSING  # a secret
        if default is not MISSING:
            yield " ".join([field.name, told(default), *map(told, field.metadata.values())])
    for name, each in () if is_dataclass(value) else vars(value).items():
        if inspect.isfunction(each):
            yield from (f"{name}.{text}" for text in _defaults(each))
        elif not name.startswith("__") and isinstance(each, (int, float, str, tuple, dict)):
            yield f"{name} {told(each)}"


def told(value: Any) -> str:
    """Return a value as text, the same in every process."""
    match value:
        case enum.Enum():
            return value.name
        case str():
            return repr(_cut(value, LONG))
        case bool() | None | int() | np.bool_():
            return str(value)
        case float() | np.number() if np.isrealobj(value):
            return short(float(value))
        case complex():
            return f"{short(value.real)} + {short(value.imag)}j"
        case re.Pattern():
            return repr(value.pattern)
        case Mapping():
            return f"{{{', '.join(f'{told(k)}: {told(v)}' for k, v in value.items())}}}"
        case Set():
            return f"{{{', '.join(sorted(map(told, value)))}}}"
        case np.ndarray():
            return f"{value.shape} {told(value.ravel()[:12].tolist())}"
        case tuple() | list():
            return f"({', '.join(map(told, value))})"
    if is_dataclass(value) and not isinstance(value, type):
        parts = [getattr(value, f.name) for f in fields(value) if f.repr]
        return f"{type(value).__name__}{told(parts)}"
    return getattr(value, "__name__", type(value).__name__)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest // 2]}… {zlib.crc32(text.encode()):08x}"


def values(folder: Path) -> Iterator[str]:
    """Yield what each function and each method of a frozen class returns whose arguments the grid has."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for _, module in modules():
            for each in vars(module).values():
                getattr(each, "cache_clear", int)()  # a kept answer calls nothing
        given = _grid()
        for called, function, owner in _functions():
            named = list(inspect.signature(function).parameters.values())
            kinds = [owner] * bool(owner) + [_kind(p.annotation) for p in named[bool(owner) :]]
            if kinds and set(kinds) <= given.keys():
                returned = list(_calls(function, [given[k] for k in kinds]))
                if not all(text.endswith("Error") for text in returned):
                    yield f"{called}: {' | '.join(returned)}"[:CALLS]


def _kind(annotation: Any) -> str:
    return annotation if isinstance(annotation, str) else getattr(annotation, "__name__", "")


def _functions() -> Iterator[tuple[str, Callable[..., Any], str]]:
    """Yield name, function and, of a method or property, the class."""
    for place, module in modules():
        for name, each in list(vars(module).items()) if PURE.match(place) else ():
            function = getattr(each, "py_func", each)
            if getattr(function, "__module__", "") != module.__name__:
                continue
            found = [(f"{place}.{name}", function, "")]
            if inspect.isclass(each):
                parts = ((n, getattr(p, "fget", getattr(p, "func", p))) for n, p in vars(each).items())
                is_frozen = is_dataclass(each) and each.__dataclass_params__.frozen  # type: ignore
                found = [(f"{place}.{name}.{n}", p, name) for n, p in parts if is_frozen and n[:2] != "__"]
            yield from (f for f in found if inspect.isfunction(f[1]) and not LEFT_OUT.match(f[0]))


def _calls(function: Callable[..., Any], given: list[tuple[Any, ...]]) -> Iterator[str]:
    parameters = inspect.signature(function).parameters.values()
    for k in range(max(map(len, given))):
        drawn = [each[k * (1 + i) % len(each)] for i, each in enumerate(given)]
        both = list(zip(parameters, drawn, strict=True))
        words = {p.name: value for p, value in both if p.kind is p.KEYWORD_ONLY}
        try:
            yield told(function(*(value for p, value in both if p.name not in words), **words))
        except RseaError as error:
            yield told(str(error))
        except Exception as error:  # an argument that makes no sense here
            yield type(error).__name__


def _grid() -> dict[str, tuple[Any, ...]]:
    """Return arguments by their annotation: plain ones, ends, and what should not come."""
    t = np.arange(60) / 280.0
    noise = np.random.default_rng(1).standard_normal(60)
    held = np.repeat(np.round(np.cumsum(noise[:20]), 1), 3)
    jittered = np.sort(t + 2e-4 * noise + 0.3 * (t > 0.101))
    sine = 3.0 * np.sin(40.0 * t) + 0.1 * noise
    arrays = (noise, t, sine, held, np.abs(noise) + 0.1, jittered, np.zeros(60), sine + 9.0 * (t > 0.101))
    rigs = tuple(rsea.load_rig(name) for name in RIGS)
    effects = tuple(effect_named(name) for name in EFFECTS)
    given: dict[str, tuple[Any, ...]] = {
        "float": (0.3, -2.5, 0.0, 17.0, 1.0, 1e-3, 240.0, np.nan), "int": (1, 2, 5, 12, 0, 280),
        "bool": (False, True), "str": ("ft", "N m", "rad", "position", "x"),
        "FloatArray": arrays, "BoolArray": tuple(a > 0.2 for a in arrays[:4]),
        "IntArray": (np.arange(6), np.array([3, 1, 4, 1, 5, 9])),
        "ComplexArray": (np.fft.fft(noise), np.exp(1j * t)),
        "Sequence[float]": ((1.0, 2.0, 4.0), (0.3,), (-1.0, 5.0)),
        "tuple[float, float]": ((0.5, 2.0), (-1.0, 1.0)),
        "Channel": (*(Channel(t, a) for a in arrays[:4]), Channel(jittered, held)),
        "Rig": rigs, "Record": tuple(_record(rig, k) for k, rig in enumerate(rigs)),
        "Effect": effects, "Parameter": tuple(p for e in effects for p in e.parameters),
    }  # fmt: skip
    given["ndarray"] = arrays
    with _kept_arguments(given):
        few = DiagnosisSettings(1, tuple(n for n in catalogue() if n not in EFFECTS[:2]))
        rubbing = _record(rigs[0].with_effect("coulomb_friction", torque=3.0), 0, 2240)
        diagnosis_report(rsea.diagnose(rubbing, rigs[0], settings=few).result)
        identification_report(rsea.identify(given["Record"][0], rigs[0]).result)
        rsea.check(given["Record"][2], rigs[0])
        asked = spring_design(Requirement(), unit_named("h54-200-s500-r"), 1500.0)
        design_report(asked, asked, asked)
        told = recordings(JOINTS, 40, causes=lambda j, d: [cause("backlash", 2e-3)] * (j == "hip" and d > 20))
        fleet_trends(history(np.random.default_rng(2), JOINTS, days=40, course=lambda j, d: 1e-3 * d), told)
        gains = Gains(0.163, 0.003528, 1.173, 8.679, 39.9)
        synthesis.check(rigs[0], load_range(rigs[0]), 280.0, gains)
    return given | {f"{name} | None": (None, *each) for name, each in given.items()}


@contextmanager
def _kept_arguments(given: dict[str, tuple[Any, ...]]) -> Iterator[None]:
    """Put the objects into the grid that functions of this package are called with, and what they hold."""

    seen: Counter[CodeType] = Counter()

    def note(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if code.co_filename.startswith(str(PACKAGE)) and seen[code] < 6:
            seen[code] += 1
            _harvest([frame.f_locals.get(name) for name in code.co_varnames[: code.co_argcount]], given)

    before = sys.gettrace()
    sys.settrace(note)
    try:
        yield
    finally:
        sys.settrace(before)


def _harvest(values: Iterable[Any], given: dict[str, tuple[Any, ...]]) -> None:
    """Put the objects of this package that some hold into the grid, up to four of a class."""
    for value in values:
        if isinstance(value, (tuple, list, Mapping)):
            _harvest(value.values() if isinstance(value, Mapping) else value, given)
        elif is_dataclass(value) and not isinstance(value, type):
            known = given.get(type(value).__name__, ())
            if len(known) < 4 and all(value is not each for each in known):
                given[type(value).__name__] = (*known, value)
                _harvest([getattr(value, f.name) for f in fields(value)], given)


def _record(rig: rsea.Rig, seed: int, count: int = 1120) -> rsea.Record:
    """Return samples of a rig; of all seeds but 0, torque at half the rate that stands still for a while."""
    u = 6.0 * np.random.default_rng(seed).standard_normal(count)
    u += 12.0 * np.sign(np.sin(0.0157 * np.arange(count)))
    record = rsea.simulate(rig, u * (0.05 if "pd" in rig.name else 1.0), 280.0, seed=seed)
    if seed == 0 or "ft" not in record:
        return record
    ft = record["ft"]
    still = np.where((ft.t > 1.0) & (ft.t < 1.3), ft.y[300], ft.y)
    return record.with_channels(ft=Channel(ft.t[::2], still[::2]))
