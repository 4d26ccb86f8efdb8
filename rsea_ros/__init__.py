"""Torque control of rotary series elastic actuators: model, identification, diagnosis, nodes.

    import rsea_ros as rsea

    data = rsea.Record.from_arrays(t, command=u, ft=tau, position=q)
    fit = rsea.identify(data, rsea.load_rig("paper_high_impedance"))
    print(fit.summary())

Each name is imported on first use; none of them needs ROS.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rsea_ros import effects
    from rsea_ros.control.controller import Measurement, TorqueController
    from rsea_ros.control.following import closed_loop
    from rsea_ros.diagnosis.settings import DiagnosisSettings
    from rsea_ros.errors import RseaError
    from rsea_ros.library.records import check, read_bag, simulate
    from rsea_ros.library.results import design, diagnose, experiment, identify, law, save
    from rsea_ros.model.observer.observer import Observer, observe
    from rsea_ros.model.prediction_errors import predict
    from rsea_ros.model.rig import Rig
    from rsea_ros.model.rig_file import load_rig
    from rsea_ros.records.record import Record

DOOR = {
    "DiagnosisSettings": "diagnosis.settings",
    "Measurement": "control.controller",
    "Observer": "model.observer.observer",
    "Record": "records.record",
    "Rig": "model.rig",
    "RseaError": "errors",
    "TorqueController": "control.controller",
    "check": "library.records",
    "closed_loop": "control.following",
    "design": "library.results",
    "diagnose": "library.results",
    "effects": "effects",
    "experiment": "library.results",
    "identify": "library.results",
    "law": "library.results",
    "load_rig": "model.rig_file",
    "observe": "model.observer.observer",
    "predict": "model.prediction_errors",
    "read_bag": "library.records",
    "save": "library.results",
    "simulate": "library.records",
}
"""The names that `import rsea_ros` offers, and the module of each."""
STUDIES = ("design", "experiment")
"""Those that are names of packages too."""

__all__ = [
    "DiagnosisSettings", "Measurement", "Observer", "Record", "Rig", "RseaError", "TorqueController", "check",
    "closed_loop", "design", "diagnose", "effects", "experiment", "identify", "law", "load_rig", "observe",
    "predict", "read_bag", "save", "simulate",
]  # fmt: skip


class _Study(ModuleType):
    # A package that can be called as the function of its name: `rsea.design(torque=40.0)`.

    @property
    def __doc__(self) -> str:  # type: ignore[override]
        """What `help(rsea.design)` shows."""
        from inspect import signature

        return f"{self.__name__}{signature(self.__wrapped__)}\n\n{self.__wrapped__.__doc__}"

    @property
    def __wrapped__(self) -> Any:
        name = self.__name__.rpartition(".")[2]
        return getattr(import_module(f"rsea_ros.{DOOR[name]}"), name)

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return self.__wrapped__(*arguments, **options)


class _Door(ModuleType):
    """This package, whoever loads the packages below it."""

    def __setattr__(self, name: str, value: object) -> None:
        if name in STUDIES and isinstance(value, ModuleType):
            value.__class__ = _Study
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Door


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("rsea_ros.version").version()
    if name not in DOOR:
        raise AttributeError(f"module 'rsea_ros' has no attribute {name!r}; it offers {', '.join(DOOR)}")
    if name in STUDIES:
        return import_module(f"rsea_ros.{name}")
    module = import_module(f"rsea_ros.{DOOR[name]}")
    globals()[name] = module if name == "effects" else getattr(module, name)
    return globals()[name]


def __dir__() -> list[str]:
    return sorted(DOOR)
