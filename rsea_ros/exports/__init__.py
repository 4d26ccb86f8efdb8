"""Rigs for other programs: the parts of a rig and its effects that each can represent, and the others."""
