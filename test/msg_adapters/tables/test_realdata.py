"""The shipped maps on the measurements that they are made for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.signal import butter, filtfilt

from msg_adapters.tables import import_record, load_map
from rsea_ros.identification.start import joint_start
from rsea_ros.model.position_loop import with_command
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.sensor_filter import SensorFilter
from rsea_ros.records.record import Record

REPOSITORY = Path(__file__).resolve().parents[3]
REAL = REPOSITORY.parent / "shared" / "realdata"
if not REAL.is_dir():
    pytest.skip(f"{REAL} is missing", allow_module_level=True)


def _import(file: str, name: str) -> Record:
    return import_record(REAL / file, load_map(REPOSITORY / "config" / "imports" / f"{name}.yaml"))


def _smooth(y: np.ndarray, cutoff: float, rate: float) -> np.ndarray:
    return filtfilt(*butter(4, cutoff / (rate / 2)), y)


@pytest.mark.parametrize("name", ["emps_identification", "emps_pulses"])
def test_emps_obeys_its_published_force_balance_and_its_controller(name):
    """M 95.109 kg, 203.503 N s/m, 20.394 N, -3.165 N: with vir·gtau as the force, pulses or not."""
    record = _import({"emps_pulses": "emps/DATA_EMPS_PULSES.mat"}.get(name, "emps/DATA_EMPS.mat"), name)
    force, q, reference = record["command"].y, record["position"].y, record["reference"].y
    smooth = _smooth(q, 20, 1000)
    v = np.gradient(smooth, 1e-3)
    model = 95.109 * np.gradient(v, 1e-3) + 203.503 * v + 20.394 * _smooth(np.sign(v), 20, 1000) - 3.165
    rest = (model - _smooth(force, 20, 1000))[100:-100]
    assert np.linalg.norm(rest) < 0.05 * np.linalg.norm(force)
    backward = np.diff(q, prepend=q[0]) / 1e-3
    controller = 243.45 * 35.15065 * (160.18 * (reference - q) - backward)
    assert np.linalg.norm((controller - force)[100:-100]) < 0.05 * np.linalg.norm(force)


def test_sea_gamma_has_one_spring_behind_two_sensors():
    """Where the motion is slow the F/T torque over the encoder's angle is the stiffness of the drawing."""
    record = _import("sea_gamma/open_5_1_31.csv", "sea_gamma")
    slow = record.between(0.5, 2.0)
    torque, angle = slow["ft"].y, slow["deflection"].y
    assert np.corrcoef(torque, angle)[0, 1] > 0.9
    assert np.polyfit(angle, torque, 1)[0] == pytest.approx(2155.0, rel=0.25)


def test_sea_gamma_behind_its_known_filters_is_predicted_where_it_took_no_part():
    """Values fitted to the run at 5 N m, held out both at 3: what is left, and twice as much without them.

    The F/T pole is that of the bare motor's steps; the tracker is `init_filter` of the authors' program
    (filterpy: F of a whole sample, Q_discrete_white_noise of 1 ms and 0.13, R 0.1), by its Riccati equation.
    """
    f, dt = np.array([[1.0, 1.0], [0.0, 1.0]]), 1e-3
    q = 0.13 * np.array([[dt**4 / 4.0, dt**3 / 2.0], [dt**3 / 2.0, dt**2]])
    p = solve_discrete_are(f.T, np.array([[1.0], [0.0]]), q, np.array([[0.1]]))
    alpha, beta = (p[:, 0] / (p[0, 0] + 0.1)).tolist()
    plain, sensors = load_rig("sea_two_encoders"), load_rig("sea_two_encoders").sensors
    known = {
        "ft": replace(sensors["ft"], filter=SensorFilter("one_pole", (0.036,)), delay=3e-3),
        "deflection": replace(
            sensors["deflection"], filter=SensorFilter("alpha_beta", (alpha, beta)), delay=9.8e-3
        ),
    }
    fitted = {"rotor.reflected_inertia": 0.0220, "rotor.reflected_damping": 0.77, "spring.stiffness": 1780.0}
    rig = replace(plain, sensors=known).with_values({**fitted, "spring.damping": 0.58})
    without = {"rotor.reflected_inertia": 0.062, "rotor.reflected_damping": 63.0, "spring.stiffness": 2036.0}
    left = {}
    for which, model in (("known", rig), ("without", plain.with_values(without))):
        runs = [predict(model, _import(f"sea_gamma/open_3_{n}.csv", "sea_gamma")) for n in ("1_25", "2_26")]
        left[which] = [np.sqrt(np.mean([run[n].rms_error**2 for run in runs])) for n in ("ft", "deflection")]
    assert left["known"][0] < 0.17 and 2155.4 * left["known"][1] < 0.50
    assert left["without"][0] > 0.28 and 2155.4 * left["without"][1] > 0.70


@pytest.mark.parametrize("joint", range(6))
def test_so101_joints_hold_what_their_targets_ask(joint):
    """A fit of a joint that begins from a regression along its motion explains most of a slow run."""
    mapping = load_map(REPOSITORY / "config" / "imports" / "so101.yaml")
    rig = load_rig("so101_joint")
    record = with_command(import_record(REAL / "so101" / "friction_gravity", mapping, joint), rig)
    begun = joint_start(record, rig).with_effect("coulomb_friction", torque=0.05)
    assert predict(begun, record.between(0.0, 30.0))["position"].fit_percent > 60.0
