"""`rsea import` and `rsea identify` on measurements of real machines, against published values (see
../shared/realdata/README.md for their origin)."""

import functools
import json
from pathlib import Path

import numpy as np
import pytest

from msg_adapters.tables import import_record, load_map
from rsea_ros.cli.main import main
from rsea_ros.diagnosis.diagnose import diagnose
from rsea_ros.diagnosis.settings import DiagnosisSettings
from rsea_ros.effects.catalogue import catalogue
from rsea_ros.identification.identify import identify
from rsea_ros.identification.result import Statics, statics_of
from rsea_ros.model.prediction_errors import predict
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import Channel, Record
from rsea_ros.report.identification import statics_sentences
from rsea_ros.report.remark_words import remark_sentences

CONFIG = Path(__file__).resolve().parents[1] / "config"
REAL = Path(__file__).resolve().parents[2] / "shared" / "realdata"
if not REAL.is_dir():
    pytest.skip(f"{REAL} is missing: no measurements of real machines to test on", allow_module_level=True)

DESIGNS = {
    "07-18__10-58-26__torqueramp__base_onyx_runin1": (1.95, True),
    "07-18__16-28-57__torqueramp__split_onyx_runin1": (1.77, True),
    "07-19__12-49-55__torqueramp__split_onyx_12pre5": (0.25, True),
    "07-19__13-53-23__torqueramp__conic_onyx_2pre1": (0.73, False),
    "07-19__13-57-00__torqueramp__conic_onyx_2pre5": (0.43, False),
}
"""Travel between -4 and +4 N m, degrees; whether the current limit stops the motor at 25 N m."""
BASE = next(iter(DESIGNS))
FRICTIONS = {"asymmetric_friction", "coulomb_friction", "stribeck_friction"}


def only(effects: set[str]) -> DiagnosisSettings:
    """Return settings in which no other effect is a candidate (bench/frozen plays the whole catalogue)."""
    return DiagnosisSettings(without=tuple(name for name in catalogue() if name not in effects))


@functools.cache
def import_file(file: str, mapping: str) -> Record:
    """Return a file of measurements as a record."""
    return import_record(REAL / file, load_map(CONFIG / f"imports/{mapping}.yaml"))


def every(record: Record, step: int) -> Record:
    """Return every so manieth sample of a record."""
    return record.with_channels(**{n: Channel(c.t[::step], c.y[::step]) for n, c in record.channels.items()})


@pytest.fixture(scope="module")
def emps(tmp_path_factory):
    """Import and identify the drive once by the command line; return the folder of the results."""
    folder = tmp_path_factory.mktemp("emps")
    bag, file = folder / "bag", REAL / "emps/DATA_EMPS.mat"
    assert main(["import", str(file), "--map", "emps_identification", "--out", str(bag)]) == 0
    assert main(["identify", str(bag), "--rig", "emps", "--out", str(folder / "results")]) == 0
    return folder / "results"


def test_emps_has_the_published_values(emps):
    """Janot, Gautier, Brunot 2019: M 95.109 kg, 203.503 N s/m, 20.394 N, offset -3.165 N."""
    outcome = json.loads((emps / "identification.json").read_text(encoding="utf-8"))["parameters"]
    published = {
        "rotor.reflected_inertia": (95.109, 0.02),
        "rotor.reflected_damping": (203.503, 0.02),
        "coulomb_friction.torque": (20.394, 0.03),
        "asymmetric_friction.offset": (-3.165, 0.10),
    }
    assert set(outcome) == set(published)
    for name, (value, tolerance) in published.items():
        assert outcome[name]["value"] == pytest.approx(value, rel=tolerance), name
        low, high = outcome[name]["ci95"]
        assert low < value < high, name
        assert high - low < 0.3 * abs(value), name


def test_emps_predicts_the_run_with_pulses(emps):
    """Held out: the force residual is at most 4.7 % of the force."""
    pulses = import_file("emps/DATA_EMPS_PULSES.mat", "emps_pulses")
    force = predict(load_rig(emps / "model.yaml"), pulses)["motor_torque"]
    rms = float(np.sqrt(np.mean(force.measured[force.counts] ** 2)))
    assert force.rms_error / rms < 0.047


def test_the_pendulum_has_its_published_gravity():
    record = import_file("pendulum/gravity_compensation.measured.csv.gz", "pendulum")
    result = identify([record], load_rig("pendulum"))
    gravity = next(p for p in result.parameters if p.name == "spring_end.gravity")
    assert gravity.value == pytest.approx(3.31, abs=0.01)
    assert gravity.ci95[0] < 3.31 < gravity.ci95[1]
    assert result.residual_rms["motor_torque"] < 0.02
    assert any(s.startswith("spring_end.inertia ran to its bound") for s in remark_sentences(result.remarks))


@pytest.mark.parametrize("design", DESIGNS)
def test_the_statics_of_a_cycloidal_design_are_as_published(design):
    travel, saturates = DESIGNS[design]
    short, long = (ramps(design, which) for which in ("short", "long"))
    assert np.degrees(short.travel) == pytest.approx(travel, abs=0.005)
    assert 0.5 * short.travel < short.lost_motion < short.travel
    assert short.limit is None
    assert 190.0 < long.stiffness < 420.0
    assert (long.limit is not None and 24.0 < long.limit < 26.0) == saturates


def ramps(design: str, which: str) -> Statics:
    record = import_file(f"cycloidal/2024-{design}.csv.gz", f"cycloidal_{which}_ramps")
    statics = statics_of(record, load_rig("cycloidal"))
    assert statics is not None
    return statics


def test_a_cycloidal_gear_is_identified():
    record = import_file(f"cycloidal/2024-{BASE}.csv.gz", "cycloidal_short_ramps")
    run = record.between(record.start, record.start + 12.0)
    short = identify([run], load_rig("cycloidal"), of_misfit=False)
    ci95 = {p.name: p.ci95 for p in short.parameters}
    assert 100.0 < ci95["spring.stiffness"][0] < ci95["spring.stiffness"][1] < 900.0
    assert ci95["coulomb_friction.torque"][0] > 0.0
    least, most = ci95["backlash.gap"]
    assert least > 0.0 and 0.5 * np.radians(1.95) < most < np.radians(1.95)
    said = remark_sentences(short.remarks)
    assert any(s.startswith("torque_saturation.limit is not identifiable") for s in said)
    shown = " ".join(statics_sentences(short.statics))
    assert "the output angle travels 1.94°" in shown  # of three ramps in five
    assert "no saturation" in shown


def test_cycloidal_saturation_is_seen_and_fitted():
    """Most of one of the three long ramps."""
    record = import_file(f"cycloidal/2024-{BASE}.csv.gz", "cycloidal_long_ramps")
    run = record.between(record.start, record.start + 15.0)
    result = identify([run], load_rig("cycloidal"), of_misfit=False)
    assert result.statics is not None and result.statics.limit is not None
    assert "stops at 24.9 N·m where " in statics_sentences(result.statics)[-1]
    outcome = {p.name: p.value for p in result.parameters}
    assert outcome["torque_saturation.limit"] == pytest.approx(result.statics.limit, rel=0.1)
    assert outcome["spring.stiffness"] == pytest.approx(result.statics.stiffness, rel=0.25)


def test_emps_is_diagnosed_with_coulomb_friction_and_its_asymmetry():
    """Coulomb friction first, then its difference between directions; no Stribeck; tested on another run.

    At 250 of its 1000 Hz: the torque is within 0.1 %, the residual 3.6 % of the force for 2.7 %.
    """
    run = every(import_file("emps/DATA_EMPS.mat", "emps_identification"), 4)
    pulses = every(import_file("emps/DATA_EMPS_PULSES.mat", "emps_pulses"), 4)
    outcome = diagnose([run], load_rig("emps"), holdout=pulses, settings=only(FRICTIONS))
    assert [c.name for c in outcome.causes] == ["coulomb_friction", "asymmetric_friction"]
    assert outcome.causes[0].parameters["torque"].value == pytest.approx(20.394, rel=0.03)
    assert "stribeck_friction" in {r.name for r in outcome.rejected}
    rms = float(np.sqrt(np.mean(pulses["motor_torque"].y ** 2)))
    assert outcome.extended_residual_rms["motor_torque"] < 0.047 * rms


def test_pendulum_is_not_given_a_friction_that_gains_nothing():
    record = import_file("pendulum/ddp.measured.csv.gz", "pendulum")
    settings = only({"coulomb_friction", "stribeck_friction"})
    outcome = diagnose([record], load_rig("pendulum"), settings=settings)
    assert outcome.verdict in ("unexplained", "partly_explained")
    for cause in outcome.causes:
        assert cause.status == "leading" and cause.gain_holdout_ci95[0] > 0.05
        assert cause.parameters["torque"].ci95[0] > 0.0
