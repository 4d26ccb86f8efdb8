"""Exports played in MuJoCo and FMPy against the own simulation, and how they differ."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from rsea_ros.design.mujoco_model import STEP
from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.exports.others import Export
from rsea_ros.model.rig import Rig
from rsea_ros.model.simulation import simulate
from rsea_ros.records.record import UNITS, Channel, FloatArray, Record

RATE = 250.0
"""Hz, of the commands that are played."""
REFINE = 4
"""Our steps are so much shorter here: the difference is to be the export's, not that of the step."""
CHANNELS = ("ft", "position", "velocity", "deflection")


@dataclass(frozen=True)
class Difference:
    """Of a channel: rms of the difference and of the channel itself, and the sensor's noise, in `unit`."""

    channel: str
    unit: str
    rms: float
    signal: float
    noise: float

    @property
    def times_noise(self) -> float:
        """Return the difference over the noise."""
        return self.rms / self.noise


def ours(rig: Rig, command: FloatArray) -> dict[str, FloatArray]:
    """Return what perfect sensors read of our simulation of a rig at the beginning of each command's hold.

    command: N m, or target rad of a rig with a position loop, at RATE.
    """
    t = np.arange(len(command)) / RATE
    rig = replace(rig, sensors={n: replace(s, delay=0.0, filter=None) for n, s in rig.sensors.items()})
    driven = "command" if rig.loop is None else "reference"
    names = [name for name in CHANNELS if rig.measures(name)]
    asked = {name: Channel(t, np.zeros(len(t))) for name in names}
    return simulate(rig, Record({driven: Channel(t, command), **asked}), refine=REFINE)


def losses(
    rig: Rig, omitted: Iterable[str], mine: Mapping[str, FloatArray], command: FloatArray
) -> dict[str, Difference]:
    """Return what each omitted effect of a rig changes, in the channel where it changes most.

    mine: of the whole rig, as `ours` gives it. command: N m or rad, at RATE.
    """
    lost = {}
    names = set(omitted)
    for name in (effect.name for effect in rig.effects if effect.name in names):
        without = rig.with_effects(*(effect for effect in rig.effects if effect.name != name))
        apart = differences(rig, mine, ours(without, command))
        if apart:
            lost[name] = max(apart, key=lambda one: one.times_noise)
    return lost


def differences(
    rig: Rig, mine: Mapping[str, FloatArray], theirs: Mapping[str, FloatArray]
) -> tuple[Difference, ...]:
    """Return the difference of each channel whose noise the rig states, N samples against N."""
    apart = []
    for name in CHANNELS:
        noise = rig.sensors[name].noise if name in rig.sensors else 0.0
        if noise > 0.0 and name in mine and name in theirs:
            rms = float(np.sqrt(np.mean((theirs[name] - mine[name]) ** 2)))
            rms = rms if math.isfinite(rms) else math.inf
            apart.append(Difference(name, UNITS[name], rms, float(np.std(mine[name])), noise))
    return tuple(apart)


PIECE = 100
"""Commands that are played in one call, which serves no signal until it returns."""
BESIDE = ("spring", "hard_stop", "hysteresis_")
"""How the names of sums of hinges begin whose torque the F/T sensor sees."""


def play_mujoco(model_text: str, rig: Rig, command: FloatArray) -> dict[str, FloatArray]:
    """Return the measurements of an exported rig's bench at the beginning of each command's hold.

    command: N m, or target rad of a rig with a position loop, at RATE. Raises ParameterError without MuJoCo,
    and for a model that MuJoCo refuses.
    """
    try:
        import mujoco
        from mujoco import rollout
    except ImportError:
        raise ParameterError(
            "playing the model needs the package mujoco (Python 3.11 or later), which is not installed: "
            "pip install mujoco, or --no-play"
        ) from None
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
            a, b, c = map(float, [*one.get("stiffness", "0").split(), "0", "0"][:3])
            low, high = map(float, [*one.get("springlength", "0 0").split(), "0"][:2])
            bent = x - _slip(x, float(one.get("springyield", "0")))
            bent -= np.clip(bent, low, high)
            total += bent * (a + bent * (b + bent * c)) + float(one.get("damping", "0")) * rate
    return total


def _slip(x: FloatArray, limit: float) -> FloatArray:
    """Return how far an elasto-plastic spring has yielded at every step (the play operator)."""
    if limit == 0.0:
        return np.zeros(len(x))
    slipped, at = np.empty(len(x)), 0.0
    for k, angle in enumerate(x.tolist()):
        at = min(max(at, angle - limit), angle + limit)
        slipped[k] = at
    return slipped


NO_NOISE = "the rig states no sensor noise, expected sensors.ft.noise or another"


@dataclass(frozen=True)
class Verification:
    """differences: of the target's play from ours, by channel; not_played: why there are none.

    losses: of each omitted effect, in the channel that it changes most.
    """

    differences: tuple[Difference, ...] = ()
    losses: Mapping[str, Difference] = field(default_factory=dict)
    not_played: str = ""


def verify(made: Export, rig: Rig, command: FloatArray) -> Verification:
    """Play a command in our simulation, without each omitted effect, and in the target where it runs here.

    command: N m, or target rad of a rig with a position loop, at RATE.
    """
    theirs: Mapping[str, FloatArray] = {}
    why = "only --mjcf and --fmu are verified by simulation"
    try:
        if made.play:
            theirs, why = made.play(made.content, rig, command), NO_NOISE
    except ParameterError as error:
        why = str(error)
    if not theirs and not {effect.name for effect in rig.effects}.intersection(made.leaves_out):
        return Verification(not_played=why)
    try:
        mine = ours(rig, command)
        apart, lost = differences(rig, mine, theirs), losses(rig, made.leaves_out, mine, command)
    except RseaError as error:  # a rig that cannot be simulated
        return Verification(not_played=str(error) if theirs else why)
    return Verification(apart, lost, "" if apart else why)
