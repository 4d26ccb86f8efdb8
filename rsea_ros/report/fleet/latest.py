"""What the latest recording of a joint names: before there are enough for a trend, that is the news."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rsea_ros.report.diagnosis.words import effect
from rsea_ros.trends.series import Table
from rsea_ros.wording import listed

_SURE = ("confirmed", "leading")


def latest_causes(joints: Sequence[str], recordings: Table) -> Mapping[str, str]:
    """Return as a text what each joint's latest finished recording names, of joints where it names any."""
    of, outcome = np.asarray(recordings["joint"], str), np.asarray(recordings["outcome"], str)
    time_s = np.asarray(recordings["time_s"], float)
    named = {}
    for joint in joints:
        done = np.flatnonzero((of == joint) & (outcome == "done"))
        if not done.size:
            continue
        last = done[np.argmax(np.nan_to_num(time_s[done]))]
        if causes := _sure(recordings["causes"][last]):
            named[joint] = listed(causes)
    return named


def _sure(causes: object) -> list[str]:
    held = causes if isinstance(causes, (list, tuple, np.ndarray)) else []
    return [effect(str(c["name"])) for c in held if c.get("status") in _SURE]
