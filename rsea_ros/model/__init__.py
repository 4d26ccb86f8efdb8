"""The nominal physics: rig, equations of motion, transfer functions, simulation."""
