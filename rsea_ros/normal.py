"""The half-width of a 95 % interval in standard deviations of a normal distribution."""

Z95 = 1.959964
"""Standard deviations from the middle of a 95 % interval to its end."""
