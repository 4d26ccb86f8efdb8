"""Torque control of rotary series elastic actuators: model, identification, diagnosis, nodes."""

import os

# Matrices here are small and the program's own threads use the cores: a second pool only gets in the way.
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
