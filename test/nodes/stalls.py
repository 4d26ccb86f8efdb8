"""Faults that a driver latches when the machine stalls for a while: tests of nodes clear them and go on."""

import time

STALLS = ("no_reply", "heldup", "ft", "effort", "deflection", "velocity", "power")
"""Beginnings of the texts of such faults; no test that clears them provokes one."""


def is_stall(fault):
    """Return whether a fault (None for none) comes from a stalled machine."""
    return (fault or "").startswith(STALLS)


def every(seconds, act):
    """Return a function that may be called at any rate and acts once in `seconds`, first after them."""
    acted = time.monotonic()

    def call():
        nonlocal acted
        if time.monotonic() - acted > seconds:
            acted = time.monotonic()
            act()

    return call
