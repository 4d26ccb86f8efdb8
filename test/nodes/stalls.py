"""Faults that a driver latches when the machine stalls for a while: tests of nodes clear them and go on."""

import time

STALLS = (
    "no_reply", "heldup", "ft", "effort", "deflection", "velocity", "power",
    "motor_state: bus_watchdog is -1", "motor_state: state is reset", "hardware_error: communication lost",
    "refused",
)  # fmt: skip
"""Beginnings of the texts of such faults; no test that clears them provokes one. A motor whose watchdog has
ended its torque refuses each goal: which of the two is told first is chance. A drive on CAN tells of its own
watchdog as a state (RS03), or as an error of which a reboot alone is the end (DM8009)."""


def is_stall(fault):
    """Return whether a fault (None for none) comes from a stalled machine."""
    return (fault or "").startswith(STALLS)


def until(condition, seconds=40.0):
    """Wait until a condition holds; return what it returned."""
    deadline = time.monotonic() + seconds
    while not (result := condition()):
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.005)
    return result
