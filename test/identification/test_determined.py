"""Which values data determine."""

from __future__ import annotations

import numpy as np

from rsea_ros.identification.result import shares_from_data


def test_values_of_which_only_a_combination_is_determined_are_not_and_nothing_is_singular():
    """Beside 1e28 the little that stands in for no information is lost: LinAlgError, told as a bug."""
    together = np.array([1e14, 1e14, 1.0])
    assert (shares_from_data(np.outer(together, together), np.ones(3)) < 1e-6).all()
    assert (shares_from_data(1e6 * np.eye(3), np.ones(3)) > 0.99).all()
