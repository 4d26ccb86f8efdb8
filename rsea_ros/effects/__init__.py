"""The catalogue of physical effects: one file each, see effect.py."""
