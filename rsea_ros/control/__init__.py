"""Torque control: a law designed from the rig, its margins over the loads, the controlled actuator."""
