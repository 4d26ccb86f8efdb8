"""Fleets over months, a live view, more export targets, a benchmark: built on the door of rsea_ros alone."""
