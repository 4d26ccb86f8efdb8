"""The sets of blocks: half the record fits, a quarter chooses, a quarter judges, whatever repeats in it."""

from __future__ import annotations

import numpy as np
import pytest

from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION, set_of

BLOCKS = np.arange(400)


@pytest.mark.parametrize(("sets", "share"), [(TRAIN, 0.5), (VALIDATION, 0.25), (TEST, 0.25)])
def test_each_set_has_its_share(sets, share):
    assert np.isin(set_of(BLOCKS), sets).mean() == share


def test_the_blocks_of_a_fit_are_neighbours():
    fits = np.isin(set_of(BLOCKS), TRAIN).reshape(-1, 4)
    assert all(np.flatnonzero(four)[1] - np.flatnonzero(four)[0] == 1 for four in fits)


@pytest.mark.parametrize("period", [2, 4, 8, 12])
def test_every_phase_of_an_excitation_that_repeats_is_in_every_set(period):
    for sets in (TRAIN, VALIDATION, TEST):
        assert set(BLOCKS[np.isin(set_of(BLOCKS), sets)] % period) == set(range(period))
