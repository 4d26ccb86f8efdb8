"""The order in which conftest.py hands out the test files names files that exist."""

from pathlib import Path

from test.conftest import COMPUTING, NODELESS, PATIENT, WAITING

HERE = Path(__file__).parent


def test_what_takes_longest_is_there():
    named = WAITING + COMPUTING + PATIENT + NODELESS
    assert [name for name in named if not list(HERE.glob(f"{name}*"))] == []
