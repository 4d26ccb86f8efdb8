"""Choose a spring.

How stiff must the spring be for the actuator to stay a pure torque source? The figure compares Eq. (7) of
the paper with the exact band, in which T_d / T_p stays within ±3 dB. The exact band also counts the spin of
the rotor.
"""

import numpy as np
import plotly.graph_objects as go

import rsea_ros as rsea
from rsea_ros.model.transfer import inner_inertia, undamped_band

rig = rsea.load_rig("paper_high_impedance")
stiffness = np.linspace(200.0, 4000.0, 200)  # N·m/rad
printed = undamped_band(stiffness, rig["chassis.inertia"])  # Hz, Eq. (7)
exact = undamped_band(stiffness, inner_inertia(rig))  # Hz

figure = go.Figure()
figure.add_scatter(x=stiffness, y=printed, name="Eq. (7)")
figure.add_scatter(x=stiffness, y=exact, name="with the rotor's spin")
figure.update_layout(xaxis_title="spring stiffness, N·m/rad", yaxis_title="bandwidth, Hz")
