"""An excitation played in MuJoCo on the exported model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from rsea_ros.design.mujoco_model import STEP
from rsea_ros.errors import ParameterError
from rsea_ros.exports.difference import RATE
from rsea_ros.model.rig import Rig
from rsea_ros.records.record import FloatArray

PIECE = 100
"""Commands that are played in one call, which serves no signal until it returns."""
BESIDE = ("spring", "hard_stop", "hysteresis_")
"""How the names of sums of hinges begin whose torque the F/T sensor sees."""


def play_mujoco(model_text: str, rig: Rig, command: FloatArray) -> dict[str, FloatArray]:
    """Return the measurements of an exported rig's bench at the beginning of each command's hold.

    command: N m, or target rad of a rig with a position loop, at RATE. Raises ParameterError without MuJoCo,
    and for a model that MuJoCo refuses.
    """
    mujoco, rollout = _mujoco()
    try:
        model = mujoco.MjModel.from_xml_string(model_text)
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ParameterError(f"MuJoCo {mujoco.__version__} refuses the model: {reason}") from None
    hold = round(1.0 / RATE / STEP)
    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SENSOR, i) for i in range(model.nsensor)]
    warnings: list[str] = []
    mujoco.set_mju_user_warning(warnings.append)  # else it writes them into a file in the working directory
    try:
        sensed = _read_sensors(mujoco, rollout, model, np.repeat(command, hold), PIECE * hold)
    finally:
        mujoco.set_mju_user_warning(None)
    if warnings:
        raise ParameterError(f"MuJoCo {mujoco.__version__}: {' '.join(warnings[0].split())}")
    read = dict(zip(names, sensed.T, strict=True))
    return {name: y[::hold] for name, y in _channels(rig, model_text, read).items()}


def _read_sensors(mujoco: Any, rollout: Any, model: Any, torque: FloatArray, piece: int) -> FloatArray:
    """Return what the model's sensors read at every step, shape (steps, sensors).

    torque: of every step, N m or target rad. piece: steps that are played in one call.
    """
    data, kind = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.zeros(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    sensed = []
    for first in range(0, len(torque), piece):
        control = np.zeros((1, len(torque[first : first + piece]), model.nu))
        control[0, :, 0] = torque[first : first + piece]
        warm = data.qacc_warmstart.copy()
        states, read = rollout.rollout(model, data, state[None], control, initial_warmstart=warm[None])
        state = states[0, -1]
        sensed.append(read[0])
    return np.concatenate(sensed)


def _channels(rig: Rig, model_text: str, read: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the rig's channels from the readings of the model's sensors at every step."""
    position, velocity = read["output"], read["output_rate"]
    if rig.encoder_end == "spring_end":
        for name in ("deflection", "play"):
            position = position - read.get(name, 0.0)
            velocity = velocity - read.get(f"{name}_rate", 0.0)
    if rig.ft_end == "housing_end":
        stiffness, damping = rig["proximal_spring.stiffness"], rig["proximal_spring.damping"]
        ft = stiffness * read["proximal"] + damping * read["proximal_rate"]
    else:
        ft = spring_torque(model_text, read["deflection"], read["deflection_rate"])
    return {"position": position, "velocity": velocity, "ft": ft, "deflection": read["deflection"]}


def spring_torque(model_text: str, x: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the torque in all sums of hinges beside the spring, N m, by the model's own laws.

    x, rate: of the spring at every step, rad, rad/s.
    """
    root = xml.fromstring(model_text)
    total = np.zeros(len(x))
    for one in root.iter("fixed"):
        if str(one.get("name")).startswith(BESIDE):
            total += _torque(one, x)
            damping = float(one.get("damping", "0"))
            total += damping * rate
    return total


def _torque(one: xml.Element, x: FloatArray) -> FloatArray:
    a, b, c = map(float, [*one.get("stiffness", "0").split(), "0", "0"][:3])
    low, high = map(float, [*one.get("springlength", "0 0").split(), "0"][:2])
    shift = _slip(x, float(one.get("springyield", "0")))
    beyond = x - shift - np.clip(x - shift, low, high)
    return np.asarray(beyond * (a + beyond * (b + beyond * c)))


def _slip(x: FloatArray, limit: float) -> FloatArray:
    """Return how far an elasto-plastic spring has yielded at every step (the play operator)."""
    if limit == 0.0:
        return np.zeros(len(x))
    slipped, at = np.empty(len(x)), 0.0
    for k, angle in enumerate(x.tolist()):
        at = min(max(at, angle - limit), angle + limit)
        slipped[k] = at
    return slipped


def _mujoco() -> tuple[Any, Any]:
    try:
        import mujoco
        from mujoco import rollout
    except ImportError:
        raise ParameterError(
            "playing the model needs the package mujoco (Python 3.11 or later), which is not installed: "
            "pip install mujoco, or --no-play"
        ) from None
    return mujoco, rollout
