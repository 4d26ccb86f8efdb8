"""Compare what effects do to the torque.

Each effect of the catalogue changes the simulated F/T torque in its own way. The figure shows the
difference to the nominal actuator for four effects, under the same sine of 15 N·m at 3 Hz.
"""

import numpy as np
from plotly.subplots import make_subplots

import rsea_ros as rsea

rig = rsea.load_rig("paper_high_impedance")
t = np.arange(560) / 280.0  # s
command = 15.0 * np.sin(2.0 * np.pi * 3.0 * t)  # N·m
effects = {
    "backlash": {"gap": 4e-3},
    "coulomb_friction": {"torque": 2.0},
    "command_delay": {"delay": 0.01},
    "torque_saturation": {"limit": 12.0},
}


def torque(bench):
    """Return the F/T torque of a bench without sensor noise, N·m."""
    return rsea.simulate(bench, command, rate=280.0, noise=False)["ft"].y


nominal = torque(rig)
changes = {name: torque(rig.with_effect(name, **sizes)) - nominal for name, sizes in effects.items()}

figure = make_subplots(rows=2, cols=2, shared_xaxes=True, subplot_titles=list(changes))
for place, change in enumerate(changes.values()):
    figure.add_scatter(x=t, y=change, row=place // 2 + 1, col=place % 2 + 1)
figure.update_xaxes(range=[1.0, 2.0])
figure.update_xaxes(title_text="time, s", row=2)
figure.update_yaxes(title_text="change, N·m", col=1)
figure.update_layout(showlegend=False)
