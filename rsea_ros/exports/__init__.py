"""Rigs for other programs: what each can say of a rig and its effects in its own terms, what it cannot."""
