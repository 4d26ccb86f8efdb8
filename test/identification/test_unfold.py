"""Integrators under hold and sampling: the closed form against the sum over images."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.identification.frequency_response import sampled_integrators


@pytest.mark.parametrize("offset", [0.0, 0.3, -0.4, -1.7])
def test_closed_form_is_the_sum_over_images(offset: float) -> None:
    x, k = np.array([0.05, 0.3, 0.44]), np.arange(-20000, 20001)
    at = x[:, None] + k
    hold = np.sinc(at) * np.exp(-1j * np.pi * at)
    turned = hold * np.exp(2j * np.pi * k * offset)
    images = np.array([np.sum(turned / (2j * np.pi * at) ** p, axis=1) for p in (1, 2, 3, 4)])
    assert sampled_integrators(x, offset) == pytest.approx(images, rel=2e-5)
