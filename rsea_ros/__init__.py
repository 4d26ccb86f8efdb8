"""Torque control of rotary series elastic actuators: model, identification, diagnosis, nodes."""
