"""Gear whose damping changes during the record, as its grease warms.

    T = -b_m · (1 + relative_change · t / duration) · ω

b_m is the damping of rotor and gear at the gear output, ω its speed against the housing. Source: Bittencourt,
Gunnarsson, Static friction in a robot joint, J. Dyn. Syst. Meas. Control 134, 2012 (viscous friction falls as
it warms).
"""

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import B_M, DURATION, GEAR_TORQUE, GEAR_VELOCITY, TIME, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Subtract the change of the damping so far, times the speed."""
    s[GEAR_TORQUE] -= s[B_M] * p[0] * (s[TIME] / s[DURATION]) * s[GEAR_VELOCITY]


EFFECT = Effect(
    name="damping_drift",
    port=Port.GEAR,
    parameters=(
        Parameter(
            "relative_change", "1", null=0.0, low=-0.95, high=5.0, typical=0.3,
            reason="cold grease is several times as thick (Bittencourt); damping never falls below zero",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0),
    function=apply,
    reads=(GEAR_VELOCITY,),
    about="damping of the gear that changes during the record",
    inspect="grease and gear that warm up: let the joint run in, and compare cold with warm",
)
