"""The layers within a folder: the diagnosis, the naming of causes, the report (docs/architecture.md)."""

from __future__ import annotations

from pathlib import Path

import pytest
from import_graph import MODULES, ROOT, imports

DIAGNOSIS = (
    {"settings", "residual_peaks", "stated_starts"},
    {"result", "data_split", "coherence", "screening"},
    {"score", "residual_analysis", "initial_guess"},
    {"problem_variants"},
    {"candidate", "criteria", "next_experiment"},
    {"selection", "step_fits", "stretches"},
    {"forward_step", "backward_elimination", "evaluation"},
    {"stepwise", "naming"},
    {"diagnose"},
)
"""Layers of rsea_ros/diagnosis: a module imports those of the lines above its own only."""
NAMING = (
    {"coefficients", "contribution"},
    {"signature", "flexible"},
    {"evidence"},
    {"rivals", "probability"},
    {"weighing"},
    {"status"},
    {"cause_facts"},
    {"outcome"},
    {"conclusion"},
)
"""Layers of its folder naming: how the selected causes are named."""

REPORT = {
    "figures": set(),
    "page": {"figures"},
    "diagnosis": {"figures", "page", "identification", "rig"},
    "identification": {"figures", "page", "rig"},
    "check": {"figures", "page", "rig"},
    "law": {"figures", "page", "rig"},
    "rig": {"page"},
    "campaign": {"figures", "page", "experiment"},
    "fleet": {"figures", "page", "diagnosis"},
    "paper": {"figures", "page", "design"},
}
"""Folders of rsea_ros/report that a folder imports; one that is not listed has figures and page alone."""

FOLDERS = {"rsea_ros.diagnosis": DIAGNOSIS, "rsea_ros.diagnosis.naming": NAMING}
"""Folders with layers of their own, by package."""


@pytest.mark.parametrize("package", FOLDERS)
def test_every_module_of_a_folder_has_a_layer(package):
    modules = [p.stem for p in folder(package).iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()]
    assert sorted(name for layer in FOLDERS[package] for name in layer) == sorted(set(modules) - {"__init__"})


@pytest.mark.parametrize(("package", "layer"), [(p, k) for p, ls in FOLDERS.items() for k in range(len(ls))])
def test_a_module_imports_only_from_the_layers_above_it(package, layer):
    allowed = set().union(*FOLDERS[package][:layer])
    for name in FOLDERS[package][layer]:
        assert used_by(package, name) <= allowed | {name}, name


def test_only_the_conclusion_of_naming_is_imported_from_outside():
    package = "rsea_ros.diagnosis.naming"
    outside = [p for p in MODULES if folder(package) not in p.parents]
    used = {m for p in outside for m, _ in imports(p, p.read_text(encoding="utf-8")) if m.startswith(package)}
    assert used == {f"{package}.conclusion"}


def folder(package: str) -> Path:
    """Return the folder of a package."""
    return ROOT.joinpath(*package.split("."))


def used_by(package: str, name: str) -> set[str]:
    """Return the modules of a package that one of them imports; of a folder, those that its modules do."""
    file = folder(package) / f"{name}.py"
    paths = [file] if file.exists() else sorted((folder(package) / name).glob("*.py"))
    modules = (module for p in paths for module, _ in imports(p, p.read_text(encoding="utf-8")))
    inside = (m.removeprefix(package + ".") for m in modules if m.startswith(package + "."))
    return {m.split(".")[0] for m in inside}


REPORT_FOLDER = ROOT / "rsea_ros" / "report"


@pytest.mark.parametrize("folder", sorted(p.name for p in REPORT_FOLDER.iterdir() if list(p.glob("*.py"))))
def test_a_folder_of_the_report_imports_only_what_it_may(folder):
    folders = {p.name for p in REPORT_FOLDER.iterdir() if p.is_dir()}
    used = set()
    for path in (REPORT_FOLDER / folder).glob("*.py"):
        modules = (module.split(".") for module, _ in imports(path, path.read_text(encoding="utf-8")))
        used |= {parts[2] for parts in modules if parts[:2] == ["rsea_ros", "report"] and len(parts) > 2}
    assert used & folders - {folder} <= REPORT.get(folder, {"figures", "page"})
