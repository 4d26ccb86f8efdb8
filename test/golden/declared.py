"""What the package declares, and what its small functions return: numbers and words that no verb may show.

It does not say that a number is right, only that it has changed: the difference belongs into the commit.
"""

from __future__ import annotations

import ast
import enum
import importlib
import inspect
import re
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from written import short

import rsea_ros as rsea
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import RseaError
from rsea_ros.records.record import Channel

PACKAGE = Path(rsea.__file__).parent
PURE = re.compile(
    r"(benchmark\.scoring|checks|control|design|diagnosis|documents|effects|experiment|exports|health|laws"
    r"|identification|model|paper|records|report|trends"
    r"|hardware\.(dynamixel\.(control_tables|frames)|netft\.rdt|peer\.protocol2|limits))(\.|$)"
)
"""Modules whose functions may be called with anything: they write nothing and wait for nothing."""
LEFT_OUT = re.compile(r".*\.(largest_gain|with_check_faults|ours|play_mujoco|_fit|bands|sample|effect_from)$")
"""Functions that would take more than 0.2 s, and one that names a temporary folder."""
LONG, WHOLE, CALLS = 40, 3000, 900
"""Characters of a text and of a constant from which on a check sum stands for them, and of calls."""
RIGS = ("paper_high_impedance", "pendulum", "two_moving_outputs", "pd_joint")
EFFECTS = ("coulomb_friction", "backlash", "ft_sensor_lag", "mains_interference", "structural_resonance")


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
        case bool() | None | int():
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
    """Yield what each function returns whose arguments the grid has, as often as it has some."""
    given = _grid()
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for called, function in _functions():
            named = [p.annotation for p in inspect.signature(function).parameters.values()]
            kinds = [kind if isinstance(kind, str) else getattr(kind, "__name__", "") for kind in named]
            if kinds and set(kinds) <= given.keys():
                returned = list(_calls(function, [given[k] for k in kinds]))
                if not all(text.endswith("Error") for text in returned):
                    yield f"{called}: {' | '.join(returned)}"[:CALLS]


def _functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    for place, module in modules():
        for name, each in list(vars(module).items()):
            function, called = getattr(each, "py_func", each), f"{place}.{name}"
            is_own = inspect.isfunction(function) and function.__module__ == module.__name__
            if is_own and PURE.match(place) and not LEFT_OUT.match(called):
                yield called, function


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
    jittered = np.sort(t + 2e-4 * noise + 0.3 * (t > 0.1))
    sine = 3.0 * np.sin(40.0 * t) + 0.1 * noise
    arrays = (noise, t, sine, held, np.abs(noise) + 0.1, jittered, np.zeros(60), sine + 9.0 * (t > 0.1))
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
    return given | {f"{name} | None": (None, *each) for name, each in given.items()}


def _record(rig: rsea.Rig, seed: int) -> rsea.Record:
    """Return 4 s of a rig; of all but the first, torque at half the rate that stands still for a while."""
    u = 6.0 * np.random.default_rng(seed).standard_normal(1120)
    u += 12.0 * np.sign(np.sin(0.0157 * np.arange(1120)))
    record = rsea.simulate(rig, u * (0.05 if "pd" in rig.name else 1.0), 280.0, seed=seed)
    if seed == 0 or "ft" not in record:
        return record
    ft = record["ft"]
    still = np.where((ft.t > 1.0) & (ft.t < 1.3), ft.y[300], ft.y)
    return record.with_channels(ft=Channel(ft.t[::2], still[::2]))
