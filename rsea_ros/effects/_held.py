"""A command that changes within a step: what a law of it makes over the step, to the exact mean.

The step knows the mean m of a held command. Where it lies between the means of its neighbours, m_b and m_a,
the command changed from one to the other after a share (m_a - m) / (m_a - m_b) of the step. Stamps that are
not on the grid, and a delay, make such steps. The mean of a clipped command is not the mean command, clipped.
"""

from rsea_ros.compiler import njit
from rsea_ros.effects.signal_table import AFTER, BEFORE, COMMAND, CURRENT, CURRENT_BEFORE


@njit(cache=True, inline="always")
def put_beside(s, before, after):  # type: ignore[no-untyped-def]
    """Note the commands (N m) of the steps before and after, where this one's mean lies between them."""
    s[BEFORE], s[AFTER] = before - s[COMMAND], after - s[COMMAND]
    if s[BEFORE] * s[AFTER] >= 0.0:
        s[BEFORE] = s[AFTER] = 0.0
    s[CURRENT_BEFORE], s[CURRENT] = both_held(s)


@njit(cache=True, inline="always")
def both_held(s):  # type: ignore[no-untyped-def]
    """Return the commands (N m) that the step begins and ends with."""
    return s[COMMAND] + s[BEFORE], s[COMMAND] + s[AFTER]


@njit(cache=True, inline="always")
def until_change(s):  # type: ignore[no-untyped-def]
    """Return the share of the step in which the first of both commands is held; 1 where there is one."""
    return s[AFTER] / (s[AFTER] - s[BEFORE]) if s[AFTER] != s[BEFORE] else 1.0


@njit(cache=True, inline="always")
def put_both(s, before, after):  # type: ignore[no-untyped-def]
    """Put what a law makes of both commands (N m) in their place, and its mean over the step."""
    share = until_change(s)
    s[COMMAND] = share * before + (1.0 - share) * after
    s[BEFORE], s[AFTER] = before - s[COMMAND], after - s[COMMAND]


@njit(cache=True, inline="always")
def put_lagged(s, changed, end, moved, moved_first):  # type: ignore[no-untyped-def]
    """Put a lagged current in the command's place: at the change and at the end of the step, N m.

    moved, moved_first: what the lag has kept back over the step, and until the change, in N m steps.
    """
    share, first = until_change(s), s[COMMAND] + s[BEFORE]
    s[COMMAND] -= moved
    if share < 1.0:
        s[BEFORE] = first - moved_first / share - s[COMMAND]
        s[AFTER] = -share / (1.0 - share) * s[BEFORE]
    s[CURRENT], s[CURRENT_BEFORE] = end, changed


@njit(cache=True, inline="always")
def scale(s, gain):  # type: ignore[no-untyped-def]
    """Multiply the command by a gain."""
    s[COMMAND] *= gain
    s[BEFORE] *= gain
    s[AFTER] *= gain
