"""What a record must have before a fit: channels that move, commands without lost cycles.

A record has the commands as they were published. Where the computer was too busy for a cycle, the motor got
none; the measured motor torque then differs from the simulated one behind the gap, and less elsewhere.
Any fault of the machine is as large elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.errors import IdentificationError
from rsea_ros.identification.result import Identification, Overlay
from rsea_ros.model.extent import LARGEST
from rsea_ros.records.record import Fault, Record
from rsea_ros.records.stamp_order import GAP


def check_usable(record: Record) -> None:
    """Raise IdentificationError for values that are not finite or stamps that do not rise."""
    for name, channel in record.channels.items():
        bad = ~((np.abs(channel.y) <= LARGEST) & np.isfinite(channel.t))
        if bad.any():
            k = int(np.argmax(bad))
            raise IdentificationError(
                f"{record.source}: {name}[{k}] at {channel.t[k]:.4f} s = {channel.y[k]}, "
                f"expected a finite value up to {LARGEST:g}"
            )
        back = np.diff(channel.t) <= 0.0
        if back.any():
            k = int(np.argmax(back)) + 1
            raise IdentificationError(
                f"{record.source}: {name} stamp {k} = {channel.t[k]:.6f} s after {channel.t[k - 1]:.6f} s, "
                "expected rising stamps"
            )


def check_excited(records: Sequence[Record]) -> None:
    """Raise IdentificationError where no record has a command that changes."""
    commands = [record["command"].y for record in records if "command" in record]
    if commands and all(len(y) == 0 or np.ptp(y) == 0.0 for y in commands):
        held = f"{commands[0][0]:.4g} N·m throughout" if len(commands[0]) else "empty"
        raise IdentificationError(
            f"{records[0].source}: torque_command is {held}, expected an excitation (chirp, multisine, noise)"
        )


KIND = "lost_cycles"
_FEWEST = 10
"""Gaps: the RMS behind fewer is known to worse than a quarter."""
_TIMES = 1.5
"""RMS behind gaps over that elsewhere, from which the gaps made it: twice what chance makes of ten gaps."""


def explained_by_lost_cycles(identification: Identification) -> int:
    """Return how many lost cycles are the likely cause of a misfit; 0 for another, and without misfit."""
    return 0 if identification.at_noise else lost_behind(identification.faults, identification.overlays)


def lost_behind(faults: Sequence[Fault], overlays: Sequence[Overlay]) -> int:
    """Return how many cycles were lost, if the motor torque of a misfit shows them; otherwise 0."""
    lost = count_of(faults)
    torque = next((o for o in overlays if o.channel == "motor_torque"), None)
    return lost if lost and torque is not None and rises_behind_gaps(torque) else 0


def count_of(faults: Sequence[Fault]) -> int:
    """Return how many cycles the nodes of the run reported as lost."""
    return round(sum(f.size or 0.0 for f in faults if f.kind == KIND))


def rises_behind_gaps(overlay: Overlay) -> bool:
    """Return whether the residual is larger in the first sample behind a gap than in the others."""
    if len(overlay.t) < 2:
        return False
    step = np.diff(overlay.t)
    behind = np.concatenate([[False], step > GAP * float(np.median(step))])
    off = np.square(overlay.measured - overlay.simulated)
    known = np.isfinite(off)
    if np.count_nonzero(behind & known) < _FEWEST or not np.any(known & ~behind):
        return False
    return bool(np.mean(off[behind & known]) > _TIMES**2 * np.mean(off[known & ~behind]))
