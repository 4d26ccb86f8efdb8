"""The feed-forward: in C and Python the effects' own physics; it helps on the second bench."""

from __future__ import annotations

import ctypes
import json
import math
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from independent.equations import DG, SIZE, G
from independent.plant import Plant
from independent.solvers import _rk4

from rsea_extras.exports.feedforward import LAWS, export_feedforward
from rsea_ros.cli.main import main
from rsea_ros.effects import signal_table as st
from rsea_ros.effects.catalogue import effect_named
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import Channel, Record

WARNINGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2")
SIZES = {
    "directional_load_friction": {"quadratic": 0.02},
    "asymmetric_friction": {"viscous_difference": 90.0},
}
PRESLIDE = ("lugre_friction", "gear_loss")
TENTHS = np.array([0.0, 0.1, 0.5, 1.0, 3.0, 11.0, 25.0, 200.0, 1000.0])
SPEEDS = 2e-3 * np.concatenate([-TENTHS, TENTHS])
"""rad/s, in usual creep velocities; from 12 to 19 of them the step's tanh is 1 to 1e-10."""


def rig_of(name):
    rig = replace(load_rig("prototype_knee"), name=name, effects=())
    return rig.with_effect(name, **SIZES.get(name, {}))


def in_python(rig):
    held = {}
    exec(export_feedforward(rig, ".py").content, held)
    return held


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Return the compiled functions by the name of an effect; the headers of all are in one program."""
    folder = tmp_path_factory.mktemp("c")
    program = ["typedef double D;"]
    for name in LAWS:
        (folder / f"{name}.h").write_text(export_feedforward(rig_of(name), ".h").content, encoding="utf-8")
        program += [
            f'#include "{name}.h"',
            f"D f_{name}(D w, D load, D motor) {{ return {name}_friction(w, load, motor); }}",
            f"D r_{name}(D q) {{ return {name}_ripple(q); }}",
            f"D a_{name}(D q, D w, D load, D motor) {{ return {name}_feedforward(q, w, load, motor); }}",
        ]
    (folder / "all.c").write_text("\n".join([*program, ""]))
    line = ["cc", *WARNINGS, "-shared", "-fPIC", "-o", "all.so", "all.c", "-lm"]
    subprocess.run(line, cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "all.so"))

    def function(short, name, arguments):
        found = library[f"{short}_{name}"]
        found.restype, found.argtypes = ctypes.c_double, [ctypes.c_double] * arguments
        return found

    return {name: [function(short, name, n) for short, n in (("f", 3), ("r", 1), ("a", 4))] for name in LAWS}


def of_the_step(rig, q, w, load, motor):
    """Return signals after the effect's function, at a constant speed of long standing."""
    effect, s, x = effect_named(rig.effects[0].name), np.zeros(st.SIZE), np.zeros(4)
    s[[st.GEAR_VELOCITY, st.OUTPUT_VELOCITY, st.B_M, st.STEP]] = w, w, rig["rotor.reflected_damping"], 1e6
    s[[st.ROTOR_ANGLE, st.LOAD]] = train_ratio(rig) * q, load
    p = np.array(effect.vector(rig.effects[0].parameters))
    for _ in range(2):
        s[[st.COMMAND, st.GEAR_TORQUE]] = motor, 0.0
        effect.function.__wrapped__(s, p, x)
    return s


@pytest.mark.parametrize("name", LAWS)
def test_c_and_python_are_the_physics_of_the_effect(name, compiled):
    rig, twin = rig_of(name), in_python(rig_of(name))
    friction, ripple, whole = compiled[name]
    for k, w in enumerate(SPEEDS):
        q, viscous = -1.3 + 0.171 * k, rig["rotor.reflected_damping"] * w
        for load, motor in ((0.0, 0.0), (7.0, 3.0), (-4.0, 9.0), (-20.0, -30.0)):
            torque = whole(q, w, load, motor)
            assert torque == pytest.approx(twin["feedforward"](q, w, load, motor), abs=1e-12)
            assert friction(w, load, motor) == pytest.approx(twin["friction"](w, load, motor), abs=1e-12)
            assert ripple(q) == pytest.approx(twin["ripple"](q), abs=1e-12)
            if LAWS[name][0] != "feedforward":
                s = of_the_step(rig, q, w, load, motor)
                is_at_rest = name in PRESLIDE and abs(w) < 0.05  # where what bends first holds anything
                assert is_at_rest or torque - viscous == pytest.approx(-s[st.GEAR_TORQUE], abs=1e-12)
            elif name == "torque_constant_error":
                s = of_the_step(rig, q, w, load, torque)
                assert s[st.COMMAND] == pytest.approx(viscous, abs=1e-12)
            else:
                s = of_the_step(rig, q, w, load, viscous)
                assert torque == pytest.approx(s[st.COMMAND], abs=1e-12)
                assert abs(w) < 1.0 or abs(torque) < abs(viscous)


@pytest.mark.parametrize("end", ["spring_end", "housing_end"])
def test_the_weight_of_a_pendulum_is_held(end):
    """Gravity begins at 0.4 rad from hanging; with the feed-forward the machine stays, without it falls."""
    rig = load_rig("pendulum" if end == "spring_end" else "paper_moving_output")
    rig = rig.with_values({f"{end}.gravity": 3.0, f"{end}.gravity_angle": 0.4})
    rig = rig.with_effect("gravity_error", torque=2.0)
    torque = in_python(rig)["feedforward"](0.0, 0.0)
    assert abs(torque) == pytest.approx(5.0 * math.sin(0.4))
    t = np.arange(250) / 250.0
    asked = {"position": Channel(t, np.zeros(250))}
    held, falling = (
        np.abs(simulate(rig, Record({"command": Channel(t, np.full(250, u)), **asked}))["position"]).max()
        for u in (torque, 0.0)
    )
    assert held < 0.02 * falling


def test_nothing_that_is_not_finite_and_nothing_beyond_the_limit_comes_out():
    rig = load_rig("pd_joint").with_effect("stribeck_friction").with_effect("torque_ripple")
    call = in_python(rig)["feedforward"]
    assert (call(0.0, 1e9), call(0.0, -1e9)) == (6.0, -6.0)
    for wrong in (math.nan, math.inf, -math.inf):
        for at in range(4):
            assert call(*(wrong if k == at else 1.0 for k in range(4))) == 0.0


def tracking_error(added, plant, seconds=12.0, rate=1000.0):
    """Return the RMS error, rad, of a slow sine through a PD loop on the second bench, spring unhooked."""
    x, k = np.zeros(SIZE), [np.zeros(SIZE) for _ in range(4)]
    errors = []
    for n in range(round(seconds * rate)):
        phase = 2.0 * math.pi * 0.1 * n / rate
        desired, speed = 0.2 * math.sin(phase), 0.2 * 2.0 * math.pi * 0.1 * math.cos(phase)
        errors.append(desired - x[G])
        torque = 400.0 * errors[-1] + 20.0 * (speed - x[DG]) + added(float(x[G]), speed)
        _rk4(x, n / rate, 1.0 / rate, 4, torque, 0.0, plant, *k)
    return float(np.sqrt(np.mean(np.square(errors[round(2.0 * rate) :]))))


def test_a_slow_sine_is_followed_fifty_times_better_on_the_second_bench():
    """Stribeck friction, more of it forward, and ripple; the model states the plant's values."""
    ripple = {"ripple": 1.0, "ripple_phase": 0.7}
    plant = Plant(k_s=0.0, b_s=0.0, coulomb=2.0, stribeck=1.5, friction_offset=0.5, **ripple)
    sizes = {"coulomb_torque": 2.0, "stribeck_torque": 1.5, "stribeck_velocity": 0.05}
    rig = load_rig("paper_high_impedance").with_effect("stribeck_friction", **sizes, creep_velocity=1.5e-3)
    rig = rig.with_effect("asymmetric_friction", offset=0.5, viscous_difference=0.0)
    rig = rig.with_effect("torque_ripple", amplitude=1.0, cycles_per_revolution=1.0, phase=0.7)
    without = tracking_error(lambda q, w: 0.0, plant)
    assert tracking_error(in_python(rig)["feedforward"], plant) < without / 50.0


def diagnosed(folder, **changed):
    """Write a model beside the diagnosis that found it, as `rsea diagnose` does, and return its path."""
    found = {"torque": 3.0, "creep_velocity": 2e-3}
    rig = load_rig("paper_high_impedance").with_effect("coulomb_friction", **{**found, **changed})
    save_rig(rig, folder / "model.yaml")
    sizes = {name: {"value": v, "ci95": [0.9 * v, 1.1 * v]} for name, v in found.items()}
    unbounded = {"rotor.reflected_damping": {"value": 23.088, "ci95": [1.0, None]}}
    document = {
        "sentence": "*/ Friction explains it.", "causes": [{"name": "coulomb_friction", "parameters": sizes}],
        "extended": {"parameters": unbounded, "residual_rms": {"ft": 0.0301}},
        "provenance": {"date": "2026-11-27", "version": "9.9.9"},
    }  # fmt: skip
    (folder / "diagnosis.json").write_text(json.dumps(document))
    return str(folder / "model.yaml")


def test_three_files_hold_the_torque_its_intervals_and_the_residual_of_the_diagnosis(tmp_path, capsys):
    out, name = tmp_path / "out", "paper_high_impedance_feedforward"
    assert main(["export", "--feedforward", diagnosed(tmp_path), "--no-play", "--out", str(out)]) == 0
    assert "says coulomb_friction: friction" in capsys.readouterr().out
    texts = {path.suffix: path.read_text(encoding="utf-8") for path in out.iterdir()}
    assert {path.stem for path in out.iterdir()} == {name} and texts.keys() == {".h", ".py", ".csv"}
    for text in texts.values():
        assert "ft 0.0301" in text and "9.9.9, 2026-11-27" in text and "Friction explains it." in text
    for kind in (".h", ".py"):
        assert "N·m, 95 %: 2.7 to 3.3" in texts[kind]


def test_the_table_holds_what_the_functions_return():
    rig = load_rig("pd_joint").with_effect("load_dependent_friction").with_effect("torque_ripple")
    held, rows = in_python(rig), export_feedforward(rig, ".csv").content.splitlines()
    rows = [row.split(",") for row in rows if not row.startswith("#")]
    assert rows[0] == ["position", "velocity", "load", "of", "torque"]
    for *at, of, torque in rows[1:]:
        q, w, load = map(float, at)
        assert float(torque) == (held[of](w, load, load) if of == "friction" else held[of](q))
    assert {(row[2], row[3]) for row in rows[1:]} == {
        ("-6.0", "friction"), ("0.0", "friction"), ("6.0", "friction"), ("0.0", "ripple"), ("0.0", "gravity"),
    }  # fmt: skip


def test_an_interval_of_a_value_that_was_changed_since_is_not_stated(tmp_path, capsys):
    out = tmp_path / "knee.py"
    source = diagnosed(tmp_path, torque=4.0)
    assert main(["export", "--feedforward", source, "--no-play", "--out", str(out)]) == 0
    text = out.read_text(encoding="utf-8")
    assert "torque = 4.0  # N·m\n" in text and "0.002  # rad/s, 95 %: 0.0018 to 0.0022" in text


@pytest.mark.parametrize("broken", ["{}", "[1]", '{"causes": 3}', "{"])
def test_a_diagnosis_that_cannot_be_read_is_one_line(broken, tmp_path, capsys):
    source = diagnosed(tmp_path)
    (tmp_path / "diagnosis.json").write_text(broken)
    assert main(["export", "--feedforward", source, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "diagnosis.json" in error
    assert not (tmp_path / "out").exists()


def test_another_suffix_is_refused(tmp_path, capsys):
    assert main(["export", "--feedforward", "pendulum", "--out", str(tmp_path / "a.c")]) == 2
    assert "expected .h, .py, .csv, or the name of a folder" in capsys.readouterr().err
