"""Health of a joint while it works: what changed against its model, by how much, since when, how sure."""
