"""The paper's statements recomputed: claims, findings, and the formulas as printed.

No other layer needs it.
"""
