"""What the friction effects share: the mean over a step of a friction torque, without limits on the step.

The law is F * w / sqrt(w^2 + w_c^2), which is F * sign(w) but for a creep below w_c = 2 mrad/s (presliding).
Over a step in which w goes straight from w_0 to w_1 its mean is, exactly,

    F * (w_0 + w_1) / (sqrt(w_0^2 + w_c^2) + sqrt(w_1^2 + w_c^2))

and w_1 depends on it: w_1 = w_free - mobility * mean. Newton's method, kept in a bracket, solves that, so sticking is no stiff problem.
"""

import math

from numba import njit

from rsea_ros.effects.signal_table import CREEP, GEAR_VELOCITY, GEAR_VELOCITY_SPAN, MOBILITY



@njit(inline="always")  # type: ignore[untyped-decorator]
def mean_friction(s, size, last):  # type: ignore[no-untyped-def]
    """Return the mean friction torque (N m, against motion when positive) of this step.

    size: friction torque at speed, N m. last: what this function returned at its last evaluation, which is
    already in the predicted end of the step.
    """
    creep = s[CREEP]
    w_0 = s[GEAR_VELOCITY] - 0.5 * s[GEAR_VELOCITY_SPAN]
    w_free = s[GEAR_VELOCITY] + 0.5 * s[GEAR_VELOCITY_SPAN] + s[MOBILITY] * last
    gain, s_0 = s[MOBILITY] * size, math.sqrt(w_0 * w_0 + creep * creep)
    low, high = w_free - abs(gain), w_free + abs(gain)
    w_1 = w_free - gain * w_0 / s_0
    for _ in range(30):
        s_1 = math.sqrt(w_1 * w_1 + creep * creep)
        mean = (w_0 + w_1) / (s_0 + s_1)
        excess = w_1 + gain * mean - w_free
        step = excess / (1.0 + gain * (1.0 - mean * w_1 / s_1) / (s_0 + s_1))
        if abs(step) < 1e-9 * creep:
            break
        low, high = (low, w_1) if excess > 0.0 else (w_1, high)
        w_1 = w_1 - step if low < w_1 - step < high else 0.5 * (low + high)
    return size * (w_0 + w_1) / (s_0 + math.sqrt(w_1 * w_1 + creep * creep))
