"""Effects that can be hidden in the second bench, by name: those of the contract, and others."""

from types import MappingProxyType

import numpy as np

CATALOGUE = MappingProxyType(
    {
        "torque_constant_error": {"gain": "torque_gain"},
        "coulomb_friction": {"torque": "coulomb"},
        "stribeck_friction": {
            "coulomb_torque": "coulomb", "stribeck_torque": "stribeck", "stribeck_velocity": "stribeck_v"},
        "asymmetric_friction": {"offset": "friction_offset", "viscous_difference": "viscous_difference"},
        "load_dependent_friction": {"coefficient": "load_friction"},
        "backlash": {"gap": "gap"},
        "nonlinear_spring": {"cubic": "cubic"},
        "spring_hysteresis": {"torque": "bouc_wen", "angle": "bouc_wen_angle"},
        "structural_resonance": {
            "frequency": "resonance_omega", "damping_ratio": "resonance_zeta", "participation": "resonance"},
        "command_delay": {"delay": "delay"},
        "current_loop_lag": {"time_constant": "current_tau"},
        "ft_sensor_lag": {"time_constant": "ft_tau"},
        "torque_ripple": {
            "amplitude": "ripple", "cycles_per_revolution": "ripple_cycles", "phase": "ripple_phase"},
        "torque_saturation": {"limit": "saturation"},
        "ft_drift": {"drift": "ft_drift"},
        "ft_bias": {"bias": "ft_bias"},
        "ft_gain_error": {"gain": "ft_gain"},
        "mains_interference": {"amplitude": "hum", "frequency": "hum_frequency"},
        "base_compliance": {"stiffness": "base_k", "inertia": "base_j"},
        "stiffness_drift": {"relative_change": "stiffness_drift"},
        "damping_drift": {"relative_change": "damping_drift"},
        "hard_stop": {"angle": "stop_angle", "stiffness": "stop_k"},
        "gear_compliance": {"stiffness": "gear_k"},
    }
)  # fmt: skip
"""Effect of the contract: its parameters, and the values of the bench that they are."""

MAIN_PARAMETER = {name: next(iter(parameters)) for name, parameters in CATALOGUE.items()}
"""The parameter that says how large an effect is, or where: the first of the contract's row."""

BESIDE_THE_CONTRACT = MappingProxyType(
    {
        "quadratic_drag": ({"coefficient": 12.0}, {"coefficient": "quadratic_drag"}),
        "dead_zone": ({"width": 4.0, "jump": 1.0}, {"width": "deadband"}),
        "torque_constant_drift": ({"relative_change": -0.2}, {"relative_change": "torque_fade"}),
        "lopsided_spring": ({"quadratic": 8.0}, {"quadratic": "quadratic"}),
        "lugre_friction": (
            {"coulomb_torque": 2.0, "bristle_stiffness": 2500.0, "stribeck_torque": 1.0,
             "stribeck_velocity": 0.03, "bristle_damping": 5.0},
            {"coulomb_torque": "lugre_coulomb", "bristle_stiffness": "bristle_k",
             "stribeck_torque": "lugre_stribeck", "stribeck_velocity": "stribeck_v",
             "bristle_damping": "bristle_b"},
        ),
        "encoder_eccentricity": (
            {"amplitude": 8.0e-5, "cycles_per_revolution": 1.0},
            {"amplitude": "eccentricity", "cycles_per_revolution": "eccentricity_cycles"},
        ),
        "current_loop_overshoot": (
            {"time_constant": 1.0 / (2.0 * np.pi * 45.0), "overshoot": 0.4443},
            {"time_constant": "current_time", "overshoot": "current_overshoot"},
        ),
        "ft_drift": (
            {"drift": 1.0, "time_constant": 8.0}, {"drift": "ft_thermal", "time_constant": "ft_thermal_tau"}),
    }
)  # fmt: skip
"""Effects of the catalogue that the contract's table lacks (and a drift that settles): medium parameters in
the catalogue's units, and the values of the bench that they are."""

OFF_CATALOGUE = MappingProxyType(
    {
        "friction_by_angle": (
            {"angle_friction": 4.0, "angle_period": 0.015},
            ("coulomb_friction", "stribeck_friction", "load_dependent_friction", "asymmetric_friction"),
        ),
        "command_rate_limit": ({"rate_limit": 2500.0}, ("current_loop_lag", "torque_saturation")),
        "quadratic_ft": ({"ft_quadratic": 0.004}, ()),
        "coarse_ft": ({"ft_quantum": 1.0}, ()),
        "impacts": ({"impact_torque": 25.0, "impact_rate": 1.5}, ()),
        "ft_random_walk": ({"ft_walk": 0.12}, ("ft_drift", "ft_bias")),
        "ft_crosstalk": ({"ft_crosstalk": 0.35}, ()),
    }
)
"""Effect outside the table: values of the bench at medium size, and effects that it can be taken for."""


def hide(bench, effect, parameters):
    """Return the bench with an effect of the contract, parameters in the contract's units."""
    fields = CATALOGUE[effect]
    values = {fields[name]: value for name, value in parameters.items()}
    if effect == "gear_compliance":
        values["encoder_on_chassis"] = 1.0  # the encoder reads the gear's output, behind its compliance
    if "resonance_omega" in values:
        values["resonance_omega"] *= 2.0 * np.pi
    return bench.with_values(**values)


def hide_beside_the_contract(bench, effect, factor=1.0):
    """Return the bench with an effect that the contract's table lacks; `factor` scales its main parameter."""
    parameters, fields = BESIDE_THE_CONTRACT[effect]
    main = next(iter(parameters))
    values = {fields[n]: v * (factor if n == main else 1.0) for n, v in parameters.items() if n in fields}
    if "current_time" in values:
        log = np.log(values.pop("current_overshoot"))
        values["current_omega"] = 1.0 / values.pop("current_time")
        values["current_zeta"] = -log / np.hypot(np.pi, log)
    return bench.with_values(**values)


def hide_off_catalogue(bench, effect, factor=1.0):
    """Return the bench with an effect outside the table; `factor` scales its size (the first value)."""
    values, _ = OFF_CATALOGUE[effect]
    size = next(iter(values))
    return bench.with_values(**{**values, size: values[size] * factor})
