"""The paper's statements recomputed: claims, findings, the formulas as printed, and their page.

No other layer needs it.
"""
