"""Spring whose stiffness changes during the record, as by warming.

    T_s = K_s · (1 + relative_change · t / duration) · d

Source: Lakes, Viscoelastic Materials, 2009 (stiffness over time and temperature).
"""

from rsea_ros.effects.effect import Claims, Effect, Parameter, compiled
from rsea_ros.effects.signal_table import DEFLECTION, DURATION, K_S, SPRING_TORQUE, TIME, Port


@compiled
def apply(s, p, x):  # type: ignore[no-untyped-def]
    """Add the change of the stiffness so far, times the deflection."""
    s[SPRING_TORQUE] += s[K_S] * p[0] * (s[TIME] / s[DURATION]) * s[DEFLECTION]


EFFECT = Effect(
    name="stiffness_drift",
    port=Port.SPRING,
    parameters=(
        Parameter(
            "relative_change", "1", null=0.0, low=-0.8, high=3.0, typical=0.1,
            reason="in one run a spring neither loses all of its stiffness nor quadruples it",
        ),
    ),
    claims=Claims("velocity", "odd", amplitude_exponent=1.0),
    function=apply,
    reads=(DEFLECTION,),
    about="stiffness of the spring that changes during the record",
    inspect="screws of the spring that work loose, a spring that warms up or settles",
)
