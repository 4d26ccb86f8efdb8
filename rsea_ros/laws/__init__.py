"""A law for what has no name: the torque that a model lacks, what it depends on, and an effect file of it."""
