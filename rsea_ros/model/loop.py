"""The position loop that ran while a record was made, at the command port.

command += k_v (k_p (reference - q) - dq/dt), limited
"""

from rsea_ros.effects.effect import compiled
from rsea_ros.effects.signal_table import COMMAND, CURRENT, OUTPUT_ANGLE, OUTPUT_VELOCITY, REFERENCE


@compiled
def control(s, p, x):  # type: ignore[no-untyped-def]
    """Add the loop's command to the outside one. p: k_p (1/s), k_v (N m s/rad), limit (N m)."""
    u = p[1] * (p[0] * (s[REFERENCE] - s[OUTPUT_ANGLE]) - s[OUTPUT_VELOCITY])
    u = min(max(u, -p[2]), p[2])
    s[COMMAND] += u
    s[CURRENT] += u
