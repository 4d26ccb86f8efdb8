"""The values of the second bench, in SI, at the gear output.

This directory shares no code with rsea_ros/model or rsea_ros/effects: it is written from the contract,
the facts and physics. Every `0.0` (or `inf`) below is an effect that is absent.
"""

from math import inf, nan
from typing import NamedTuple


class Plant(NamedTuple):
    """Constants of the equations of motion; a tuple of floats, so that compiled code can read it.

    Bodies: housing h, gear output g (it carries the rotor's reflected inertia), chassis c, base b, which
    holds the far end of the spring. Units: kg m^2, N m s/rad, N m/rad, N m, rad, s.
    """

    j_m: float = 0.953  # rotor, reflected
    b_m: float = 23.088  # gear, reflected
    k_s: float = 1530.456
    b_s: float = 3.0
    j_sc: float = 0.0040
    ratio: float = 502.0
    duration: float = 60.0  # over which drifts run

    housing_free: float = 0.0  # 1: the housing turns with a pendulum on it
    j_h: float = 0.101
    k_h: float = 7.0
    b_h: float = 0.02

    torque_gain: float = 1.0  # true over nominal torque constant
    torque_fade: float = 0.0  # relative change of it over the record
    current_tau: float = 0.0  # first-order current loop
    current_omega: float = 0.0  # second-order current loop, rad/s
    current_zeta: float = 0.7
    delay: float = 0.0

    v_0: float = 1.5e-3  # rad/s over which tanh(v/v_0) stands for the sign
    coulomb: float = 0.0
    stribeck: float = 0.0  # extra at rest
    stribeck_v: float = 0.05
    friction_offset: float = 0.0  # mean of forward and backward drag, as signed torques
    viscous_difference: float = 0.0  # forward less backward
    one_sided: float = 0.0  # the other reading of "one-sided": drag in the forward direction only
    one_sided_b: float = 0.0
    load_friction: float = 0.0
    quadratic_drag: float = 0.0
    angle_friction: float = 0.0  # Coulomb friction that comes and goes with the output angle
    angle_period: float = 0.015
    bristle_k: float = 0.0  # LuGre
    bristle_b: float = 0.0
    lugre_coulomb: float = 0.0
    lugre_stribeck: float = 0.0
    damping_drift: float = 0.0

    ripple: float = 0.0
    ripple_cycles: float = 1.0
    ripple_phase: float = 0.0
    cogging: float = 0.0  # second wave, bound to the output angle
    cogging_period: float = 0.02

    gap: float = 0.0  # backlash between gear output and chassis, whole width
    contact_k: float = 1.0e6
    contact_b: float = 40.0
    gear_k: float = 0.0  # compliance between gear output and chassis
    gear_b: float = 0.2
    encoder_on_chassis: float = 0.0  # behind the gap or the soft gear, not before it

    cubic: float = 0.0
    quadratic: float = 0.0  # a spring softer one way than the other, 1/rad
    bouc_wen: float = 0.0
    bouc_wen_angle: float = 2.0e-3
    bouc_wen_beta: float = 1.0  # 0.5: unloading starts with the slope of loading
    stop_angle: float = inf
    stop_k: float = 0.0
    stiffness_drift: float = 0.0
    base_k: float = 0.0
    base_j: float = 0.1
    base_zeta: float = 0.02

    resonance: float = 0.0  # participation
    resonance_omega: float = 200.0
    resonance_zeta: float = 0.03
    ft_tau: float = 0.0


class Outside(NamedTuple):
    """Values outside the equations of motion: the drive's treatment of a command, and the sensors."""

    saturation: float = inf
    deadband: float = 0.0
    rate_limit: float = inf  # N m/s
    impact_torque: float = 0.0  # half-sine knocks on the gear output
    impact_rate: float = 1.0  # per second

    ft_gain: float = 1.0
    ft_bias: float = 0.0
    ft_drift: float = 0.0  # over the record
    ft_thermal: float = 0.0  # N m, reached exponentially
    ft_thermal_tau: float = 10.0
    ft_walk: float = 0.0  # random walk, N m/sqrt(s)
    ft_quadratic: float = 0.0  # 1/(N m)
    ft_crosstalk: float = 0.0  # N m RMS of a force axis with noise of its own
    ft_crosstalk_low: float = 4.0  # Hz
    ft_crosstalk_high: float = 14.0
    hum: float = 0.0
    hum_frequency: float = 50.0
    hum_phase: float = nan  # rad; not a number: another one in every record
    eccentricity: float = 0.0  # rad, in the encoder
    eccentricity_cycles: float = 1.0  # per turn of the rotor

    ft_noise: float = 0.03
    ft_quantum: float = 0.0
    position_quantum: float = 1.2518225e-5
    velocity_noise: float = 2.0e-4
    velocity_quantum: float = 2.0863738e-4
    motor_noise: float = 0.05
    motor_quantum: float = 0.05
    stamp_quantum: float = 2.0**-22  # s: an epoch in 64-bit floating point seconds


class Bench(NamedTuple):
    """One bench: the plant and what surrounds it."""

    plant: Plant = Plant()
    outside: Outside = Outside()

    def with_values(self, **values):
        """Return the bench with other values, by the field names of Plant and Outside."""
        inner = {k: float(v) for k, v in values.items() if k in Plant._fields}
        outer = {k: float(v) for k, v in values.items() if k in Outside._fields}
        unknown = set(values) - set(inner) - set(outer)
        if unknown:
            raise KeyError(f"no such value of the bench: {sorted(unknown)}")
        return Bench(self.plant._replace(**inner), self.outside._replace(**outer))
