"""Strict YAML and the values in it: numbers, units, keys, settings, and the words of its errors."""
