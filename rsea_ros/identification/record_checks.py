"""Requirements on records for identification: finite values, rising stamps, a command that changes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rsea_ros.errors import IdentificationError
from rsea_ros.model.extent import LARGEST
from rsea_ros.records.record import Record


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
