"""The sets of blocks: half of a record for training, a quarter each for validation and test."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.diagnosis.data_split import TEST, TRAIN, VALIDATION, block_length, set_of
from rsea_ros.diagnosis.settings import BlockSettings

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


@pytest.mark.parametrize(
    ("duration", "rule", "length"),
    [
        (160.0, BlockSettings(), 1.0),
        (60.0, BlockSettings(), 0.5),
        (8.0, BlockSettings(), 0.25),
        (8.0, BlockSettings(shortest=0.05), 8.0 / 120),
    ],
)
def test_the_length_of_a_block_follows_the_record_and_the_settings(duration, rule, length):
    assert block_length(SimpleNamespace(duration=duration), rule) == length
