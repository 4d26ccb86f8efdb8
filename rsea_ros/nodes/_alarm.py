"""To react to a signal at once: Python's handlers wait until the main thread comes back from a wait in C."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable

from rsea_ros.processes import STOPPING


class SignalListener:
    """Call `react()`, in a thread, at the first signal that ends the process, beside the handlers it has."""

    def __init__(self, react: Callable[[], None]) -> None:
        self._react = react
        self._outlet, self._inlet = os.pipe()
        os.set_blocking(self._inlet, False)
        self._main = threading.current_thread() is threading.main_thread()  # not permitted to other users
        if self._main:
            self._before = signal.set_wakeup_fd(self._inlet, warn_on_full_buffer=False)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Listen no more."""
        if self._inlet < 0:
            return
        if self._main:
            signal.set_wakeup_fd(self._before)
        os.close(self._inlet)
        self._inlet = -1
        self._thread.join()
        os.close(self._outlet)

    def _listen(self) -> None:
        while numbers := os.read(self._outlet, 64):
            if set(STOPPING).intersection(numbers):
                self._react()
