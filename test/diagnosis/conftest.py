"""Eliminations by a script."""

from __future__ import annotations

import pytest


@pytest.fixture
def world(monkeypatch):
    """Make a backward elimination on scripted fits, with some effects as rivals."""
    from scripted_elimination import World  # its tests alone need it

    return lambda fits, *effects: World(monkeypatch, fits, *effects)
