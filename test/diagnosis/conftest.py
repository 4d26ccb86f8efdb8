"""Make the second bench importable as `independent`, and eliminations scripted."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))
sys.path.append(str(Path(__file__).parent))  # scripted and its siblings, which are no tests


@pytest.fixture
def world(monkeypatch):
    """Make a backward elimination on scripted fits, with some effects as rivals."""
    from scripted_elimination import World  # its tests alone need it

    return lambda fits, *effects: World(monkeypatch, fits, *effects)
