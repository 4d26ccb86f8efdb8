"""The order in which conftest.py hands out the test files names files that exist."""

from pathlib import Path

from test.conftest import COMPUTING, PATIENT, WAITING

HERE = Path(__file__).parent


def test_what_takes_longest_is_there():
    assert [name for name in WAITING + COMPUTING + PATIENT if not list(HERE.glob(f"{name}*"))] == []
