"""Name a cause.

The bench has a Coulomb friction of 4 N·m that the rig lacks. The diagnosis names it, estimates its size and
simulates the record with it. The figure shows half a second: the measurement, the simulation before, and
the simulation with the cause.
"""

import numpy as np

import rsea_ros as rsea

rig = rsea.load_rig("paper_high_impedance")
command = 12.0 * np.random.default_rng(2).standard_normal(2800)  # N·m, at 280 Hz
run = rsea.simulate(rig.with_effect("coulomb_friction", torque=4.0), command, rate=280.0)
diagnosis = rsea.diagnose(run, rig)
print(diagnosis.summary())

cause = diagnosis.causes[0]
figure = diagnosis.plot()
figure.update_xaxes(range=[4.0, 4.5])
figure.update_layout(height=700)
