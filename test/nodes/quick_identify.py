"""The node identify with a diagnosis of two causes: whom it answers does not depend on that."""

from functools import partial

from rsea_ros.diagnosis import diagnose as module
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.nodes import identify

TRIED = "coulomb_friction", "current_loop_lag"


def main() -> int:
    """Be the node."""
    few = DiagnosisSettings(without=tuple(name for name in catalogue() if name not in TRIED))
    module.diagnose = partial(module.diagnose, settings=few)
    return identify.main()
