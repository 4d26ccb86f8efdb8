"""Estimate the torques on both ends.

With both ends clamped, a chirp from 1 to 60 Hz drives the actuator. The observer estimates the distal
torque T_d and the proximal torque T_p from the command, the encoder and the F/T sensor. The two torques
differ at high frequency, where the spring chassis and the rotor take up torque: there the actuator is not a
pure torque source.
"""

import numpy as np
import plotly.graph_objects as go
from scipy.signal import chirp

import rsea_ros as rsea
from rsea_ros.model.observer.observer import observe

rig = rsea.load_rig("paper_high_impedance")
t = np.arange(2800) / 280.0  # s
run = rsea.simulate(rig, 10.0 * chirp(t, 1.0, 10.0, 60.0), rate=280.0)
stamps, estimates = observe(rsea.Observer(rig), run)
distal, proximal = estimates[:, 0], estimates[:, 1]  # N m

figure = go.Figure()
figure.add_scatter(x=stamps, y=distal, name="T_d, distal")
figure.add_scatter(x=stamps, y=proximal - distal, name="T_p − T_d")
figure.update_layout(xaxis_title="time, s", yaxis_title="torque, N·m")
