"""Extensions of an embedded Dask scheduler that keep its memory flat while tasks come without a pause."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from distributed.scheduler import DEFAULT_EXTENSIONS
from distributed.spans import SpansSchedulerExtension


class UnlistedSpans(SpansSchedulerExtension):
    """Spans without Dask's list of all submissions: it grows for as long as any task is in flight."""

    def observe_tasks(self, tss: Any, code: Any, span_metadata: Any) -> dict[Any, dict[Any, Any]]:
        """Note new tasks as Dask does, but not the kind of collection that they were submitted as."""
        nothing: Any = None
        return super().observe_tasks(tss, code, nothing)


def embedded_extensions() -> Mapping[str, Any]:
    """Return Dask's extensions by name, without stealing: a task that waits does not move between workers."""
    kept = {name: extension for name, extension in DEFAULT_EXTENSIONS.items() if name != "stealing"}
    return {**kept, "spans": UnlistedSpans}
