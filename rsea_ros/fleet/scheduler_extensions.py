"""Extensions of an embedded Dask scheduler that keep its memory flat while tasks come without a pause."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from distributed.scheduler import DEFAULT_EXTENSIONS
from distributed.spans import SpansSchedulerExtension


class UnlistedSpans(SpansSchedulerExtension):
    """Spans without Dask's list of all submissions: it grows for as long as any task is in flight."""

    def observe_tasks(self, tss: Iterable[Any], **stated: Any) -> dict[Any, dict[Any, Any]]:
        """Note new tasks as Dask does, but not the kind of collection that they were submitted as."""
        kept = {name: None if name == "span_metadata" else value for name, value in stated.items()}
        observed: dict[Any, dict[Any, Any]] = super().observe_tasks(tss, **kept)
        return observed


def embedded_extensions() -> Mapping[str, Any]:
    """Return Dask's extensions by name, without stealing: a task that waits does not move between workers."""
    kept = {name: extension for name, extension in DEFAULT_EXTENSIONS.items() if name != "stealing"}
    return {**kept, "spans": UnlistedSpans}
