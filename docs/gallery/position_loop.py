"""Identify a joint from position targets.

Most robots log target positions and an encoder, and no torque. The rig then states the position loop of the
firmware, and the fit simulates the closed loop. The figure shows the measured and the simulated position.
"""

import numpy as np

import rsea_ros as rsea
from rsea_ros.library.notebook import overlay_figure

rig = rsea.load_rig("pd_joint")
t = np.arange(2000) / 100.0  # s, targets at 100 Hz
target = 0.4 * np.sin(2.0 * np.pi * 0.5 * t) + 0.2 * np.sin(2.0 * np.pi * 1.3 * t)  # rad
bench = rig.with_values({"rotor.reflected_damping": 1.3 * rig["rotor.reflected_damping"]})
fit = rsea.identify(rsea.simulate(bench, target, rate=100.0), rig)
print(fit.summary())

damping = fit.parameters["rotor.reflected_damping"]
figure = overlay_figure(fit.result.overlays)
