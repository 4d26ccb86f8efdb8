"""Torque control of rotary series elastic actuators: model, identification, diagnosis, nodes.

    import rsea_ros as rsea

    data = rsea.Record.from_arrays(t, command=u, ft=tau, position=q)
    fit = rsea.identify(data, rsea.load_rig("paper_high_impedance"))
    print(fit.summary())

Each name is imported on first use; none of them needs ROS.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rsea_ros import effects
    from rsea_ros.control.controller import TorqueController
    from rsea_ros.diagnosis.settings import DiagnosisSettings
    from rsea_ros.errors import RseaError
    from rsea_ros.library.checking import check
    from rsea_ros.library.diagnosed import diagnose
    from rsea_ros.library.identified import identify
    from rsea_ros.library.records import read_bag, simulate
    from rsea_ros.model.observer.observer import Observer, observe
    from rsea_ros.model.prediction_errors import predict
    from rsea_ros.model.rig import Rig
    from rsea_ros.model.rig_file import load_rig
    from rsea_ros.records.record import Record

DOOR = {
    "DiagnosisSettings": "diagnosis.settings",
    "Observer": "model.observer.observer",
    "Record": "records.record",
    "Rig": "model.rig",
    "RseaError": "errors",
    "TorqueController": "control.controller",
    "check": "library.checking",
    "diagnose": "library.diagnosed",
    "effects": "effects",
    "identify": "library.identified",
    "load_rig": "model.rig_file",
    "observe": "model.observer.observer",
    "predict": "model.prediction_errors",
    "read_bag": "library.records",
    "simulate": "library.records",
}
"""The names that `import rsea_ros` offers, and the module of each."""

__all__ = [
    "DiagnosisSettings", "Observer", "Record", "Rig", "RseaError", "TorqueController", "check", "diagnose",
    "effects", "identify", "load_rig", "observe", "predict", "read_bag", "simulate",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in DOOR:
        raise AttributeError(f"module 'rsea_ros' has no attribute {name!r}; it offers {', '.join(DOOR)}")
    module = import_module(f"rsea_ros.{DOOR[name]}")
    value = module if name == "effects" else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(DOOR)
