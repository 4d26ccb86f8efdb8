"""Estimate the torques on both ends.

A chirp from 10 to 60 Hz drives the actuator with both ends clamped. The observer estimates the distal
torque T_d and the proximal torque T_p from the command, the encoder and the F/T sensor. The figure shows
their relative difference: above 0.3, near 48 Hz, the actuator is not a pure torque source.
"""

import numpy as np
import plotly.graph_objects as go
from scipy.signal import chirp

import rsea_ros as rsea

rig = rsea.load_rig("paper_high_impedance")
t = np.arange(2800) / 280.0  # s
run = rsea.simulate(rig, 10.0 * chirp(t, 10.0, 10.0, 60.0), rate=280.0)
_, estimates = rsea.observe(rsea.Observer(rig), run)
distal, proximal = estimates[:, 0].reshape(20, 140), estimates[:, 1].reshape(20, 140)  # N·m, by half seconds
share = np.sqrt(np.mean((proximal - distal) ** 2, axis=1) / np.mean(distal**2, axis=1))
frequency = 10.0 + 5.0 * (0.25 + 0.5 * np.arange(20))  # Hz

figure = go.Figure(go.Scatter(x=frequency, y=share))
figure.add_hline(y=0.3, line_dash="dot", annotation_text="tolerance of the flag pure_torque")
figure.update_layout(xaxis_title="frequency, Hz", yaxis_title="RMS of T_p − T_d over RMS of T_d")
