"""Writes which functions of rsea_ros each file of tests calls; loaded by pytest and by all that tests start.

A line is `file of tests, tab, module, tab, function`, or `file, tab, seconds of CPU`; RECORD names the file
of lines. A step of test/golden stands for a file. Not seen are compiled functions, those that ran in a
fixture of another file, and what runs while a module is imported: for whatever test comes first.
PYTEST_DONT_REWRITE: it is loaded before pytest is.
"""

import os
import resource
import sys
import threading
from pathlib import Path
from types import FrameType

PACKAGE = str(Path(__file__).resolve().parents[2] / "rsea_ros") + os.sep
LINES = os.open(os.environ["RECORD"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
STEPS = "test/golden/test_golden.py"
FUNCTION = 0x2
"""CO_NEWLOCALS: a code object of a function, not of a module or a class."""

_seen: set[int] = set()
_last: list[float | str] = ["", 0.0]


def unit(nodeid: str) -> str:
    """Return what a test counts for: its file, or itself."""
    return nodeid if nodeid.startswith(STEPS) else nodeid.partition("::")[0]


def note(frame: FrameType, event: str, argument: object) -> None:
    """Write a function at its first call."""
    code = frame.f_code
    if id(code) in _seen:
        return
    is_own = code.co_filename.startswith(PACKAGE) and bool(code.co_flags & FUNCTION)
    if is_own and _is_importing(frame):
        return
    _seen.add(id(code))
    if is_own:
        place = unit(os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" ")[0])
        target = code.co_filename.removeprefix(PACKAGE).removesuffix(".py")
        if place:
            os.write(LINES, f"{place}\t{target}\t{code.co_name}\n".encode())


def _is_importing(frame: FrameType | None) -> bool:
    """Return whether a function runs for the body of a module of the package."""
    while frame is not None:
        code = frame.f_code
        if code.co_name == "<module>" and code.co_filename.startswith(PACKAGE):
            return frame.f_globals["__name__"] != "__main__"
        frame = frame.f_back
    return False


def _used() -> float:
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def pytest_runtest_logstart(nodeid: str, location: object) -> None:
    """Begin anew with each file. An exception inside `note`, as a signal raises, has ended the tracing."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        sys.settrace(note)  # type: ignore[arg-type]
        _next(unit(nodeid))


def pytest_sessionfinish(session: object) -> None:
    """Write the seconds of the last file."""
    _next("")


def _next(place: str) -> None:
    before, since = _last
    if place != before:
        if before:
            os.write(LINES, f"{before}\t{_used() - float(since):.2f}\n".encode())
        _last[:] = [place, _used()]
        _seen.clear()


os.register_at_fork(after_in_child=_seen.clear)
threading.settrace(note)  # type: ignore[arg-type]
sys.settrace(note)  # type: ignore[arg-type]
