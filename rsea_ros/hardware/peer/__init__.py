"""The bench on a wire: the far end of the driver's cables, sharing no code with the driver."""
