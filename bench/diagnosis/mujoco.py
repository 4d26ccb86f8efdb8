"""The same swept sine through MuJoCo and through our plant: the prototype in a knee, open loop.

The engine gets bodies, bearings and one pair of teeth (design/mujoco_model.py); the direction of the rotor,
and so whether T_d/T_p resonates, is a result of the engine.

MuJoCo is among the packages of the tests, for Python 3.11 or later.
Run: python -m bench diagnosis mujoco [RIG] [--train TRAIN] [--seconds 20]
Status 1 when they differ by more than 2 % in gain or 3 degrees in phase up to 100 Hz, or by more than 5 % in
|T_d/T_p| at a line off its resonance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from bench import parser_of
from rsea_ros.design.mujoco_model import STEP, mjcf
from rsea_ros.model import outputs
from rsea_ros.model.bandwidth import inner_inertia
from rsea_ros.model.equations import train_ratio
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import simulate
from rsea_ros.model.train import TRAINS
from rsea_ros.model.transfer import frequency_response
from rsea_ros.records.record import Channel, FloatArray, Record

LOW, HIGH, TOP = 0.5, 130.0, 100.0
"""Hz: of the sweep, and up to where the two must agree."""
AMPLITUDE = 1.0
GAIN, PHASE = 0.02, 3.0
ENDS, PEAK = 0.05, 10.0
"""Largest difference in |T_d/T_p|, and the gain above which no line counts: a sweep is too short there."""
LINES = (1.0, 2.0, 5.0, 10.0, 15.35, 19.9, 28.4, 40.0, 60.0, 80.0, 100.0)


def sweep(seconds: float) -> FloatArray:
    """Return a logarithmic sweep of AMPLITUDE N m that fades in and out, and half as long of rest."""
    t = STEP * np.arange(round(seconds / STEP))
    rise = np.log(HIGH / LOW)
    phase = 2.0 * np.pi * LOW * seconds / rise * np.expm1(t / seconds * rise)
    window = np.clip(np.minimum(t / 0.5, (seconds - t) / 0.3), 0.0, 1.0)
    return np.concatenate([AMPLITUDE * window * np.sin(phase), np.zeros(len(t) // 2)])


def by_mujoco(rig: Rig, command: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return T_d (N m) and the velocity of the load on the housing's end (rad/s) at the end of every step."""
    model = mujoco.MjModel.from_xml_string(mjcf(rig))
    data = mujoco.MjData(model)
    joints = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) for i in range(model.njnt)]
    loaded = "proximal" if "proximal" in joints else "housing"
    load = np.array([name == loaded for name in joints], float)
    spring = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TENDON, "spring")
    k_s, b_s = rig["spring.stiffness"], rig["spring.damping"]
    torque, velocity = np.empty(len(command)), np.empty(len(command))
    for i, u in enumerate(command):
        data.ctrl[0] = u
        mujoco.mj_step(model, data)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        torque[i] = k_s * data.ten_length[spring] + b_s * data.ten_velocity[spring]
        velocity[i] = load @ data.qvel
    return torque, velocity


def by_plant(rig: Rig, command: FloatArray) -> FloatArray:
    """Return T_d of our compiled plant at the end of every step, N m."""
    t = STEP * np.arange(len(command))
    record = Record({"command": Channel(t, command), "ft": Channel(t + STEP, np.zeros(len(t)))})
    return simulate(rig, record)["ft"]


def agreement(theirs: FloatArray, ours: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return frequency (Hz), gain ratio - 1 and phase difference (degrees) from LOW to TOP."""
    hz = np.fft.rfftfreq(len(ours), STEP)
    band = (hz >= LOW) & (hz <= TOP)
    ratio = np.fft.rfft(theirs)[band] / np.fft.rfft(ours)[band]
    return hz[band], np.abs(ratio) - 1.0, np.degrees(np.angle(ratio))


def end_to_end(rig: Rig, torque: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return |T_d / T_p| at LINES: MuJoCo's, with T_p from what moves the housing, and our model's."""
    hz = np.fft.rfftfreq(len(torque), STEP)
    lines = np.array([np.argmin(np.abs(hz - f)) for f in LINES])
    s = 2j * np.pi * hz[lines]
    load = rig["housing_end.inertia"] * s + rig["housing_end.damping"] + rig["housing_end.stiffness"] / s
    theirs = np.abs(np.fft.rfft(torque)[lines] / (load * np.fft.rfft(velocity)[lines]))
    ends = [
        frequency_response(rig, outputs.end_torque(rig, e), hz[lines]) for e in ("spring_end", "housing_end")
    ]
    return theirs, np.abs(ends[0] / ends[1])


def main(argv: Sequence[str]) -> int:
    """Print the agreement."""
    parser = parser_of(__doc__)
    parser.add_argument("rig", nargs="?", default="prototype_knee")
    parser.add_argument("--seconds", type=float, default=20.0, help="of the sweep (default %(default)s)")
    parser.add_argument("--train", choices=TRAINS, help="of the gear (default: the rig's)")
    args = parser.parse_args(argv)
    rig, command = load_rig(args.rig), sweep(args.seconds)
    rig = replace(rig, train=args.train) if args.train else rig
    torque, velocity = by_mujoco(rig, command)
    ours = by_plant(rig, command)
    hz, gain, phase = agreement(torque, ours)
    print(f"train: {rig.train}, n = {train_ratio(rig):+g}; inner inertia {inner_inertia(rig):+.5f} kg·m²")
    print(f"{rig.name}: T_d/T_m, MuJoCo {mujoco.__version__} beside our plant, sweep {LOW:g} to {HIGH:g} Hz")
    print("      Hz     gain, dB   MuJoCo, %   phase, deg")
    response = frequency_response(rig, outputs.end_torque(rig, "spring_end"), np.array(LINES))
    for f, h in zip(LINES, response, strict=True):
        i = int(np.argmin(np.abs(hz - f)))
        print(f"{f:8.1f} {20 * np.log10(abs(h)):12.2f} {100 * gain[i]:+11.3f} {phase[i]:+12.3f}")
    print(
        f"largest to {TOP:g} Hz: {100 * np.abs(gain).max():.3f} % in gain, {np.abs(phase).max():.3f} deg "
        "in phase"
    )
    apart = 0.0
    if rig.end_is_free("housing_end"):
        theirs, expected = end_to_end(rig, torque, velocity)
        print(f"|T_d/T_p|, dB: MuJoCo {_row(theirs)}\n                 ours {_row(expected)}")
        apart = float(np.abs(theirs / expected - 1.0)[expected < PEAK].max())
        print(f"largest, where it is below {20 * np.log10(PEAK):.0f} dB: {100 * apart:.3f} %")
    return int(np.abs(gain).max() > GAIN or np.abs(phase).max() > PHASE or apart > ENDS)


def _row(gains: FloatArray) -> str:
    return " ".join(f"{20 * np.log10(g):7.2f}" for g in gains)
