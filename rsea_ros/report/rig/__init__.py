"""Which rig a result was made with, and the values that differ from it."""
