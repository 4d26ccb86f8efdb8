"""Devices: the simulated actuator, behind the interface that real ones have."""
