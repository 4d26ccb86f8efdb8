"""What a simulation gets wrong, why, the extended model, and the gain: the scientific method, one file a verb."""
