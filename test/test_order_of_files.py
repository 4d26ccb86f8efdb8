"""The order in which conftest.py hands out the test files names files that exist."""

from pathlib import Path

import pytest

from test.conftest import COMPUTING, WAITING

HERE = Path(__file__).parent


@pytest.mark.parametrize("name", WAITING + COMPUTING)
def test_what_takes_longest_is_there(name):
    assert list(HERE.glob(f"{name}*"))
