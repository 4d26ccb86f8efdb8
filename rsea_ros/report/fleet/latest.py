"""Causes in the latest recording of a joint, for a fleet with too few recordings for trends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rsea_ros.documents.wording import list_names
from rsea_ros.report import words
from rsea_ros.trends.series import Table

_SURE = ("confirmed", "leading")


def latest_causes(joints: Sequence[str], recordings: Table) -> Mapping[str, str]:
    """Return the causes in each joint's latest finished recording as text, for joints with any.

    A joint whose recordings have no date has no latest one.
    """
    of, outcome = np.asarray(recordings["joint"], str), np.asarray(recordings["outcome"], str)
    time_s = np.asarray(recordings["time_s"], float)
    named = {}
    for joint in joints:
        done = np.flatnonzero((of == joint) & (outcome == "done") & np.isfinite(time_s))
        if not done.size:
            continue
        last = done[np.argmax(time_s[done])]
        if causes := _sure(recordings["causes"][last]):
            named[joint] = list_names(causes)
    return named


def _sure(causes: object) -> list[str]:
    held = causes if isinstance(causes, (list, tuple, np.ndarray)) else []
    return [words.effect(str(c["name"])) for c in held if c.get("status") in _SURE]
