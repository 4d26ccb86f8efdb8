"""How torque follows sines: its phase, continuous from where it is followed."""

import numpy as np
import pytest

from rsea_ros.control.following import Following
from rsea_ros.report.figures.figure import AFTER
from rsea_ros.report.figures.response import ResponseCurve, response_figure

HZ = np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0])
FOLLOWED = np.array([1.0, 1.0, 0.7, 0.2]) * np.exp(-1j * np.radians([0.0, 5.0, 100.0, 200.0]))


def curve(*unheard):
    """Return a response that is followed from 5 Hz on; below, only the phases (deg) of its remains differ."""
    remains = 0.02 * np.exp(1j * np.radians(unheard))
    return Following(HZ, np.concatenate([remains, FOLLOWED]), np.ones(len(HZ)))


@pytest.mark.parametrize("unheard", [(-100.0, -30.0), (170.0, -170.0), (60.0, -150.0), (-150.0, -175.0)])
def test_the_phase_of_what_is_followed_does_not_hang_on_what_is_not(unheard):
    """At 1 kHz the plot of the free load stood 360 degrees below that at 280 Hz."""
    phase = curve(*unheard).phase
    assert phase[2:] == pytest.approx([0.0, -5.0, -100.0, -200.0])
    assert phase[:2] == pytest.approx(unheard)


def test_a_plot_shows_the_phase_that_it_is_given():
    shown = curve(170.0, -170.0)
    drawn = response_figure("", [ResponseCurve("", AFTER, HZ, shown.torque, phase=shown.phase)]).data
    assert drawn[-1]["y"] == pytest.approx(shown.phase, abs=1e-3)
