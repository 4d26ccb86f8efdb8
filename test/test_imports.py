"""What the syntax tree of every module says: who imports whom, arguments, units, who writes files."""

import ast
import re
import sys
from pathlib import Path

import pytest
from import_graph import MODULES, ROOT, found_in_modules, imports, name_of, nodes, tree_of

from rsea_ros import DOOR

BASE = {"errors", "records", "documents", "outputs", "plugins", "processes", "progress", "version"}
CORE = BASE | {"effects", "model", "identification", "checks", "diagnosis", "control", "design"}
AROUND = {"laws", "experiment", "health", "exports"}
OWN = {
    **{name: set() for name in ("errors", "progress", "version", "processes", "compiler")},
    "plugins": {"errors"},
    "documents": {"errors"},
    "records": {"errors", "documents"},
    "outputs": {"errors", "processes"},
    "effects": BASE | {"compiler"},
    "model": BASE | {"effects", "compiler"},
    "identification": BASE | {"effects", "model"},
    "checks": BASE | {"effects", "model", "identification"},
    "diagnosis": BASE | {"effects", "model", "identification", "checks"},
    "control": BASE | {"effects", "model"},
    "design": BASE | {"model"},
    "laws": BASE | {"effects", "model", "identification", "checks", "diagnosis", "compiler"},
    "experiment": BASE | {"effects", "model", "identification", "checks", "diagnosis"},
    "health": BASE | {"effects", "model"},
    "exports": BASE | {"effects", "model", "design"},
    "paper": BASE | {"effects", "model", "identification", "design", "report"},
    "hardware": BASE,
    "hardware.simulated": BASE | {"model"},
    "msg_adapters": BASE,
    "report": CORE | AROUND,
    "library": CORE | AROUND | {"report", "msg_adapters"},
    "nodes": CORE | AROUND | {"hardware", "report", "msg_adapters"},
    "cli": CORE | AROUND | {"paper", "hardware", "report", "msg_adapters", "nodes"},
    "extension": CORE | AROUND | {"report", "msg_adapters", "nodes", "cli"},
    "__main__": {"cli"},
    "__init__": CORE | {"library"},
}
"""Layers of this project that a layer may import beside itself; none imports the extras or the extension."""

EXTRAS = {
    "trends": set(),
    "pages": {"trends"},
    "fleet": {"trends", "pages"},
    "exports": set(),
    "watch": set(),
    "benchmark": set(),
    "cli": {"trends", "pages", "fleet", "watch", "benchmark"},
}
"""Parts of rsea_extras, and those that each may import beside itself."""
PUBLIC = {
    "rsea_ros": "the door, its names alone",
    "rsea_ros.extension.base": "one way to refuse, to read documents and to write files; arrays of a record",
    "rsea_ros.extension.rigs": "rigs, effects, import maps and topics as text: the door has objects",
    "rsea_ros.extension.recording": "a fleet keeps what each step finds; the door does them at once",
    "rsea_ros.extension.page": "pages and result files that look alike",
    "rsea_ros.extension.verb": "options, tables and exit status of a verb",
    "rsea_ros.extension.node": "parameters, clock and health of a node, and its message types",
    "rsea_ros.extension.target": "what an export states of a rig, from the equations that the simulation has",
}
"""What rsea_extras may import of rsea_ros, with the reason; test/extras/test_registered.py: it needs all."""

NUMERIC = {"numpy", "scipy", "control", "numba", "llvmlite"}
MESSAGES = {
    "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs", "rcl_interfaces",
    "rosgraph_msgs", "rosidl_runtime_py", "sensor_msgs", "std_msgs", "std_srvs",
}  # fmt: skip
FOREIGN = {
    "documents": {"yaml"},
    "records": {"numpy"},
    "compiler": {"numba"},
    "identification": NUMERIC | {"threadpoolctl"},
    **dict.fromkeys(("effects", "model", "checks", "diagnosis", "control", "design"), NUMERIC),
    **dict.fromkeys(("laws", "experiment", "health", "paper"), NUMERIC),
    "exports": NUMERIC | {"mujoco"},
    "library": {"numpy", "plotly", "rich"},
    "hardware": {"numpy", "dynamixel_sdk", "serial", "can"},
    "msg_adapters": {"numpy", "scipy", "yaml", "rosbags", "lz4", "backports", "compression"}
    | {"pyarrow"}
    | MESSAGES,
    "report": {"numpy", "rich"},
    "nodes": {"numpy", "rclpy", "rich", "yaml"},
    "cli": {"numpy", "rich", "rclpy", "yaml"},
    "rsea_extras.trends": {"numpy", "scipy"},
    "rsea_extras.fleet": {"numpy", "dask", "distributed", "fsspec", "pyarrow", "duckdb"},
    "rsea_extras.pages": {"numpy"},
    "rsea_extras.exports": {"numpy", "fmpy", "pythonfmu3"},
    "rsea_extras.watch": {"tornado", "rclpy"},
    "rsea_extras.benchmark": {"numpy"},
}
"""Packages of others that a layer may import beside the standard library."""


def layer_of(module: str) -> str:
    """Return the layer of a module of this project, the longest name that the table has."""
    name = module.removeprefix("rsea_ros.") if module != "rsea_ros" else "__init__"
    fitting = [layer for layer in OWN if name == layer or name.startswith(layer + ".")]
    assert fitting, f"{module} lies in no layer of docs/architecture.md"
    return max(fitting, key=len)


def offences(path: Path, source: str | ast.Module) -> list[str]:
    """Return the forbidden imports of a source at that path."""
    name = name_of(path)
    extra = ".".join(name.split(".")[:2]) if name.startswith("rsea_extras") else ""
    layer = extra or layer_of(name)
    may = extra_may_import if extra else may_import
    forbidden = [(module, line) for module, line in imports(path, source) if not may(layer, module)]
    return [f"line {line}: layer {layer} may not import {module}" for module, line in forbidden]


def may_import(layer: str, module: str) -> bool:
    """Return whether the tables allow it; a part of a layer belongs to that layer too."""
    whole, top = layer.split(".")[0], module.split(".")[0]
    if top in ("rsea_ros", "msg_adapters"):
        return layer_of(module).split(".")[0] in OWN[layer] | {whole}
    return top in sys.stdlib_module_names or top in FOREIGN.get(whole, set())


def extra_may_import(layer: str, module: str) -> bool:
    """Return whether a part of rsea_extras may: the public modules, and the names of the door."""
    top, _, rest = module.partition(".")
    if top == "rsea_ros":
        return module in PUBLIC or rest in DOOR
    if top == "rsea_extras":
        own = layer.partition(".")[2]
        return rest.split(".")[0] in EXTRAS[own] | {own}
    return top in sys.stdlib_module_names or top in FOREIGN.get(layer, set())


def test_a_module_imports_only_what_its_layer_may():
    assert found_in_modules(offences) == []


@pytest.mark.parametrize(
    ("place", "source", "count"),
    [
        ("rsea_ros/model/rig.py", "def f():\n    import rclpy", 1),
        ("rsea_ros/effects/backlash.py", "from ..model import rig", 1),
        ("rsea_ros/nodes/plant.py", "from sensor_msgs.msg import JointState", 1),
        ("msg_adapters/bags.py", "from rsea_ros.model.rig import Rig", 1),
        ("rsea_ros/cli/main.py", "from rsea_extras.cli import fleet", 1),
        ("rsea_ros/model/rig.py", "from rsea_ros.extension.base import quote", 1),
        ("rsea_extras/fleet/store.py", "from rsea_ros.model.rig import Rig", 1),
        ("rsea_extras/fleet/store.py", "from rsea_ros import model", 1),
        ("rsea_extras/trends/days.py", "from rsea_extras.fleet import store", 1),
        ("rsea_ros/model/rig.py", "import numpy as np\nfrom rsea_ros.effects.effect import Effect", 0),
        ("rsea_ros/hardware/simulated.py", "from rsea_ros.model.simulation import Plant", 0),
        ("rsea_ros/report/figures/response.py", "import numpy\nfrom ...identification import result", 0),
        ("rsea_extras/fleet/store.py", "import pyarrow\nfrom rsea_ros import Record, Rig", 0),
        ("rsea_extras/pages/page.py", "from rsea_extras.trends.days import Days", 0),
    ],
)
def test_an_offence_is_found_and_an_allowed_import_passes(place, source, count):
    assert len(offences(ROOT / place, source)) == count


MOST = 9
"""Arguments of a function: values that belong together are one value."""


def argument_counts(tree: ast.Module) -> dict[str, int]:
    """Return how many arguments each function of a module takes, self included."""
    functions = (n for n in nodes(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef))
    return {f.name: _count(f.args) for f in functions}


def _count(args: ast.arguments) -> int:
    return len([*args.posonlyargs, *args.args, *args.kwonlyargs, *filter(None, (args.vararg, args.kwarg))])


def long_signatures(path: Path, tree: ast.Module) -> list[str]:
    """Return the functions of a module that take too many arguments."""
    return [f"{name} takes {count}" for name, count in argument_counts(tree).items() if count > MOST]


def test_no_function_takes_ten_arguments():
    assert found_in_modules(long_signatures) == []


def test_every_kind_of_argument_counts():
    source = "class A:\n    def f(self, a, /, b, *c, d, **e): ...\nasync def g(): ..."
    assert argument_counts(ast.parse(source)) == {"f": 6, "g": 0}


SPACED = re.compile(r"(?<![A-Za-z(])[mk]?N ?m(?![A-Za-z])|kg m\^2")
ALONE = re.compile(r"(1/|rad/)?\(?([mk]?N ?m|kg m\^2)\)?(\^\d)?( s(\^\d)?)?((/\(?(rad|s|A)\)?)(\^\d)?){0,2}")
READ_AS_FILES = (
    "units.py", "effect_source.py", "column_units.py", "factors.py", "bench/inputs/formats.py",
)  # fmt: skip
"""Modules that read units, or write files."""


def texts(path: Path) -> list[str]:
    """Return the texts of a module that are no docstrings, parts of f-strings too."""
    found = nodes(tree_of(path))
    docstrings = {id(n.value) for n in found if isinstance(n, ast.Expr)}
    return [n.value for n in found if _is_text(n) and id(n) not in docstrings]


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def test_messages_tables_and_plots_spell_units_in_one_way():
    """The page of `rsea control` had `N m` in its key numbers and `N·m` in its plots."""
    wrong = {
        f"{path.relative_to(ROOT)}: {text!r}"
        for path in (*MODULES, *(ROOT / "bench").rglob("*.py"))
        if not str(path).endswith(READ_AS_FILES)
        for text in texts(path)
        if SPACED.search(text) and not ALONE.fullmatch(text)
    }
    assert wrong == set()


def test_the_docs_spell_units_in_one_way():
    """Import maps and rigs show what a file may hold: code, and the rows that list spellings."""
    code = re.compile(r"```(yaml|text)?\n.*?```|`[^`]*`", flags=re.DOTALL)
    pages = {page.name: page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md")}
    wrong = {name: SPACED.findall(code.sub("", text)) for name, text in pages.items()}
    assert {name: found for name, found in wrong.items() if found} == {}


WRITERS = {
    "rsea_ros/outputs/files.py",
    "rsea_ros/hardware/peer/serial_line.py",  # names a link to its terminal
    "msg_adapters/compression.py",  # unpacks into a temporary folder
}
WRITING = {"write_text", "write_bytes", "rename", "renames", "tofile", "savez", "save", "savetxt", "to_csv"}
"""Only files.py writes: any other code that writes could replace a file or leave a partial one."""


def places_that_write(path: Path, tree: ast.Module) -> list[int]:
    """Return the lines of a module that write a file without files.py."""
    if str(path.relative_to(ROOT)) in WRITERS:
        return []
    return [node.lineno for node in nodes(tree) if isinstance(node, ast.Call) and writes(node)]


def writes(call: ast.Call) -> bool:
    """Return whether a call writes a file: by its name, or by the mode that it opens one with."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name == "open":
        modes = [a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
        return any(set(mode) <= set("rwaxbt+") and set(mode) & set("wa+") for mode in modes)
    method = isinstance(call.func, ast.Attribute)
    on_os = method and isinstance(call.func.value, ast.Name) and call.func.value.id == "os"
    return (method and name in WRITING) or (on_os and name == "replace")


def test_a_module_writes_only_through_files():
    assert found_in_modules(places_that_write) == []


@pytest.mark.parametrize(
    ("source", "found"),
    [('p.write_text("x")', [1]), ('open(p, "w")', [1]), ('p.open("ab")', [1]), ("os.replace(a, b)", [1]),
     ("a.rename(b)", [1]), ("write_text(p, s)", []), ('p.open("xb")', []), ('text.replace("a", "b")', []),
     ("open(p)", [])],
)  # fmt: skip
def test_a_place_that_writes_is_found(source, found):
    assert places_that_write(ROOT, ast.parse(source)) == found
