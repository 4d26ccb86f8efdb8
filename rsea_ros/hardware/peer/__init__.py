"""The simulated bench behind real wires: the peer of the driver, sharing no code with it."""
