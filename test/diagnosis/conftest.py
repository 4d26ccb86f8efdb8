"""What many diagnoses share."""

import pytest

from rsea_ros.diagnosis import next_experiment


@pytest.fixture
def brief_next_run(monkeypatch):
    """Simulate 4 s and not 12 of each run that would separate rivals, where nobody looks at that run."""
    monkeypatch.setattr(next_experiment, "_LENGTH", 4.0)
