"""Which causes a session of experiments weighs: few, so that a round takes seconds."""

from __future__ import annotations

from rsea_ros.effects.catalogue import effect_named
from rsea_ros.errors import ParameterError

USUAL = (
    "coulomb_friction",
    "stribeck_friction",
    "backlash",
    "nonlinear_spring",
    "spring_hysteresis",
    "hard_stop",
    "torque_constant_error",
    "ft_gain_error",
    "command_delay",
    "ft_sensor_lag",
    "current_loop_lag",
    "torque_saturation",
)
"""Of a gear, a spring and their sensors. Each one more costs a fit a round."""


def causes_from(text: str) -> tuple[str, ...]:
    """Return the effects of `backlash,hard_stop`. Raises ParameterError for unknown, repeated, or none."""
    names = tuple(effect_named(name.strip()).name for name in text.split(",") if name.strip())
    if not names or len(set(names)) < len(names):
        raise ParameterError(f"causes = {text!r}, expected effects of the catalogue, each once")
    return names
