"""The mutated modules, and the tests that must notice: those of the module that run in a second or two.

Tests are run in this order up to the first that fails. The slow tests of whole records would kill more, but
late: a table test must hold each decision function.
"""

from __future__ import annotations

GUARD = (
    "hardware/test_limit_tables.py",
    "hardware/test_guard_tables.py",
    "hardware/test_unmeasured_tables.py",
    "hardware/test_limits.py",
)

TARGETS: dict[str, tuple[str, ...]] = {
    "hardware/limits": GUARD,
    "hardware/guarded": (
        "hardware/test_guarded.py",
        "hardware/test_guarded_services.py",
        "hardware/test_limits.py",
    ),
    "identification/noise": ("identification/test_noise_tables.py",),
    "identification/noise_level": (
        "identification/test_noise_level_tables.py",
        "identification/test_coloured_tables.py",
    ),
    "identification/clocks": (
        "identification/test_clock_tables.py",
        "identification/test_drift_tables.py",
        "identification/test_lag_line_tables.py",
    ),
    "diagnosis/score": ("diagnosis/test_score_tables.py", "diagnosis/test_known_values.py"),
    "diagnosis/criteria": ("diagnosis/test_criteria.py", "diagnosis/test_known_values.py"),
    "diagnosis/stepwise": ("diagnosis/test_stepwise_tables.py",),
    "diagnosis/backward_elimination": ("diagnosis/test_elimination_tables.py",),
}
"""By module below rsea_ros: files below test."""
