"""A number of the normal distribution that every 95 % interval is made of."""

Z95 = 1.959964
"""Standard deviations from the middle of a 95 % interval to its end."""
