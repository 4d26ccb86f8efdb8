"""Nodes, thin: parameters to objects, callbacks of three lines, exceptions to diagnostics and a log line."""

import sys
from types import TracebackType

from rsea_ros.processes import one_thread_for_blas

one_thread_for_blas()  # before numpy is imported by any node

_told_before = sys.excepthook


def _tell(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Report Ctrl-C in one line: a node's imports take a second, in which it handles no signals yet."""
    if issubclass(kind, KeyboardInterrupt):
        print("interrupted before it began", file=sys.stderr)  # noqa: T201
    else:
        _told_before(kind, error, trace)


sys.excepthook = _tell
