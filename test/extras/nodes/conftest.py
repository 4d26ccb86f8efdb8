"""Real node processes, and a listener in this one."""

from test.nodes.conftest import listener, start, what_a_test_hears  # noqa: F401  fixtures
