"""The order in which conftest.py hands out the test files names files that exist."""

from pathlib import Path

import pytest

from test.conftest import DEAREST

HERE = Path(__file__).parent


@pytest.mark.parametrize("name", DEAREST)
def test_every_file_in_the_list_of_the_longest_exists(name):
    assert list(HERE.glob(f"{name}*"))
