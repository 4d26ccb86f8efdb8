"""Torque control of rotary series elastic actuators: model, identification, diagnosis, nodes."""

import os

from rsea_ros.compiler_cache import choose_cache

# Matrices here are small and the program's own threads use the cores: a second pool only gets in the way.
for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

choose_cache()
