"""Progress: the callback by which long work reports its present stage."""

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Hears what is being done and which share of the work is over, 0 … 1."""
