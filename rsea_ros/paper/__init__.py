"""What the paper says, recomputed: claims, findings, and the formulas as printed. Nothing else needs it."""
