"""What a machine that stands still for a while makes a driver latch: tests of nodes clear it and go on."""

import time

STALLS = ("no_reply", "heldup", "ft", "effort", "deflection", "velocity", "power")
"""How such faults begin; no test that clears them provokes one."""


def is_stall(fault):
    """Return whether a fault, None for none, is one of a machine that stood still."""
    return (fault or "").startswith(STALLS)


def every(seconds, act):
    """Return what may be called at any rate and acts once in so many seconds, the first time after them."""
    acted = time.monotonic()

    def called():
        nonlocal acted
        if time.monotonic() - acted > seconds:
            acted = time.monotonic()
            act()

    return called
