"""What a simulation gets wrong, why, the extended model, and the gain: one file a verb."""
