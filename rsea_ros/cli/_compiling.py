"""One line on the terminal while the simulation is compiled for the first time."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

COMPILER = "rsea_ros.compiler"


class _LineHandler(logging.Handler):
    """Writes each message as a line on stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a message."""
        print(f"rsea: {record.getMessage()}", file=sys.stderr, flush=True)


@contextmanager
def compilation_announced() -> Iterator[None]:
    """In this block the compiler says on stderr that it compiles, if stderr is a terminal."""
    if sys.stderr is None or not sys.stderr.isatty():
        yield
        return
    logger, line = logging.getLogger(COMPILER), _LineHandler()
    level = logger.level
    logger.addHandler(line)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(line)
        logger.setLevel(level)
