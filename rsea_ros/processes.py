"""Processes: child programs that never outlive their parent, signals that ask to stop, threads of algebra.

Matrices here are small and the program's threads use the cores: a second pool only gets in the way. A
library must not change its user's environment, so only the command line and the nodes call this.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

PATIENCE = 10.0
"""s that a program gets to end: a driver ramps its torque down and switches it off."""
_PRCTL, _PARENT_DEATH_SIGNAL = ctypes.CDLL(None).prctl, 1


def start(command: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
    """Start a program in a session of its own: a terminal's Ctrl-C reaches it through this process alone.

    options: of Popen.
    """
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=_follow, **options
    )


def stop(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """Ask programs to end (SIGTERM) and wait; kill those that do not."""
    for process in processes:
        if process.poll() is None:
            process.terminate()
    for process in processes:
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _follow() -> None:
    """Have the kernel end this process when the one that started it is killed."""
    _PRCTL(_PARENT_DEATH_SIGNAL, signal.SIGTERM)


STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
AGAIN = 0.1
"""s after which a stop is asked for again that code which cannot pass on an exception has swallowed."""


class Stopped(KeyboardInterrupt):
    """A signal asks this process to stop; code that handles Ctrl-C handles it.

    status: 128 plus the number. note: what the stopped work reports, or empty.
    """

    note = ""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number, self.status = number, 128 + number


class Stops:
    """In this block a signal of STOPPING raises Stopped in the main thread, unless it is ignored (nohup).

    last: the one that came, which an import may have turned into another error.
    """

    def __init__(self) -> None:
        self.last: Stopped | None = None

    def __enter__(self) -> Stops:
        self._handlers = {}
        self._hook = sys.unraisablehook
        if threading.current_thread() is threading.main_thread():
            sys.unraisablehook = self._swallow
            for number in STOPPING:
                if (handler := signal.getsignal(number)) is not signal.SIG_IGN:
                    self._handlers[number] = handler
                    signal.signal(number, self._raise)
        return self

    def __exit__(self, *error: object) -> None:
        sys.unraisablehook = self._hook
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        self.last = Stopped(number)
        raise self.last

    def _swallow(self, report: sys.UnraisableHookArgs) -> None:
        if not isinstance(report.exc_value, Stopped):
            self._hook(report)
            return
        main = threading.main_thread().ident
        again = threading.Timer(AGAIN, signal.pthread_kill, [main, report.exc_value.number])
        again.daemon = True
        again.start()


@contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Let no thread or process that begins in this block receive the Ctrl-C of the terminal.

    The terminal sends it to every process of the verb at once; the one that runs the verb ends the others.
    Here it counts after the block.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def hold_signals() -> Iterator[None]:
    """Hold signals back until the block is over; the first of them counts then."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread receives signals
        return
    held: list[int] = []
    before = {n: handler for n in STOPPING if (handler := signal.getsignal(n)) is not None}
    for number in before:
        signal.signal(number, lambda number, frame: held.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if held:
            signal.raise_signal(held[0])


VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread_for_blas() -> None:
    """Request one thread, unless the user has set another number. Must run before numpy is imported."""
    for name in VARIABLES:
        os.environ.setdefault(name, "1")
