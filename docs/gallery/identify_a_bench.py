"""Identify a bench.

Simulate a bench that differs from its rig, record 10 s of noise, and fit the rig. The figure shows the
measured and the fitted frequency response from motor torque to F/T torque.
"""

import numpy as np

import rsea_ros as rsea

rig = rsea.load_rig("paper_high_impedance")
bench = rig.with_values({"spring.stiffness": 1400.0, "rotor.reflected_damping": 18.0})
command = 15.0 * np.random.default_rng(1).standard_normal(2800)  # N·m, at 280 Hz
fit = rsea.identify(rsea.simulate(bench, command, rate=280.0), rig)
print(fit.summary())

stiffness = fit.parameters["spring.stiffness"]
figure = fit.plot()
