"""A bench with a hidden cause, the causes that are weighed, and the runs that may be designed."""

from independent.bench import Bench
from independent.hidden import hide

from rsea_ros.experiment.proposal import DesignRequest
from rsea_ros.experiment.run_shape import RunLimits
from rsea_ros.model.rig_file import load_rig

RIG = load_rig("paper_high_impedance")
CAUSES = ("current_loop_lag", "hard_stop")
ASKED = DesignRequest(RunLimits(torque=20.0, velocity=2.0), refine=0, kinds=("multisine",), longest=2.0)
BENCH = hide(Bench(), "current_loop_lag", {"time_constant": 3e-3})
