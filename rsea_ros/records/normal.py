"""Quantiles of the normal distribution, in standard deviations."""

Z95 = 1.959964
"""Standard deviations from the middle of a 95 % interval to its end."""
Z90 = 1.6449
"""The same of a 90 % interval."""
MAD_TO_SD = 1.4826
"""Standard deviation of normal values over their median absolute deviation."""
