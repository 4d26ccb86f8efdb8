"""The findings of a check: on a terminal and for programs."""
