"""Every effect in every target: exported or left out and, where the target runs here, its difference from
this project's simulation.

    python -m bench packaging exports            the rigs that have a spring, all effects, MuJoCo
    python -m bench packaging exports paper_high_impedance --fmu    the same in FMUs

A line for each rig and effect: difference / size of the effect, both in times the sensor's noise, by channel.
Status 1 where a nominal rig differs by more than NOMINAL, the allowed difference of the integrators.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rsea_ros.effects.catalogue import catalogue
from rsea_ros.errors import RseaError
from rsea_ros.exports.bam import export_bam
from rsea_ros.exports.fmu import export_fmu
from rsea_ros.exports.isaac import export_isaac
from rsea_ros.exports.mjcf import export_mjcf
from rsea_ros.exports.urdf import export_sdf, export_urdf
from rsea_ros.exports.verification import RATE, differences, ours, play_fmu, play_mujoco
from rsea_ros.identification.excitation import JOINT, ExcitationSettings, excitation
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig, rig_names
from rsea_ros.records.record import FloatArray

NOMINAL = 0.1
"""Times the sensor's noise."""


def main(rigs: tuple[str, ...] = (), *, fmu: bool = False, seconds: float = 2.0) -> int:
    """Print the tables.

    rigs: all that a target takes, where none is named
    fmu: play FMUs, not MuJoCo
    seconds: of the chirp
    """
    words()
    worst = 0.0
    for name in rigs or rig_names():
        rig = load_rig(name)
        if not rig.rigid_spring or fmu:
            worst = max(worst, play_rig(rig, command(rig, seconds), fmu))
    return int(worst > NOMINAL)


def words() -> None:
    """Print how many effects each target can express, and which it leaves out."""
    targets: dict[str, Callable[[Rig], object]] = {
        "mjcf": export_mjcf, "sdf": export_sdf, "urdf": export_urdf, "isaac": export_isaac, "bam": export_bam,
    }  # fmt: skip
    for target, export in targets.items():
        left = [name for name in catalogue() if name in {one.name for one in _make(export, name).omitted}]
        count = f"{len(catalogue()) - len(left)} of {len(catalogue())} effects"
        print(f"{target}: says {count}; leaves out {', '.join(left)}")


def _make(export: Callable[[Rig], object], name: str) -> object:
    base = "paper_moving_output" if name == "gravity_error" else "paper_high_impedance"
    return export(load_rig(base).with_effect(name))


def command(rig: Rig, seconds: float) -> FloatArray:
    """Return the chirp, N m or rad."""
    base = JOINT if rig.loop else ExcitationSettings(amplitude=10.0, noise=2.0, high=60.0)
    return excitation("chirp", replace(base, rate=RATE, duration=seconds, low=0.5))


def play_rig(rig: Rig, given: FloatArray, is_fmu: bool) -> float:
    """Print a line for each effect; return the largest nominal difference of a rig without a loop."""
    export, play = (export_fmu, play_fmu) if is_fmu else (export_mjcf, play_mujoco)
    nominal = ours(rig, given, RATE)
    worst = 0.0
    for name in ("", *catalogue()):
        try:
            one = rig.with_effect(name) if name else rig
            mine = ours(one, given, RATE)
            apart = differences(one, mine, play(export(one).content, one, given))
        except RseaError as error:
            print(f"{rig.name:22} {name or 'nominal':26} {error}")
            if not name:
                break
            continue
        size = {d.channel: d.times_noise for d in differences(one, mine, nominal)}
        cells = (f"{d.channel} {d.times_noise:.2g} / {size[d.channel]:.3g}" for d in apart)
        print(f"{rig.name:22} {name or 'nominal':26} {'   '.join(cells)}", flush=True)
        if not name and rig.loop is None:
            worst = max(d.times_noise for d in apart)
    return worst
