"""Damage of an MCAP file as it comes along: how often each kind, and the first of each."""

from __future__ import annotations

from msg_adapters.contents import Contents

UNITS = {
    "damaged_chunks": "chunks",
    "damaged_messages": "messages",
    "damaged_records": "bytes",
    "data_after_end": "records",
    "unknown_records": "records",
}
"""Unit of the size of each kind of fault."""


class Damage:
    """Counts by kind of fault, with the first detail."""

    def __init__(self) -> None:
        self._count: dict[str, int] = {}
        self._detail: dict[str, str] = {}

    def add(self, kind: str, detail: str, count: int = 1) -> None:
        """Count one more; the first detail of a kind is kept."""
        self._count[kind] = self._count.get(kind, 0) + count
        self._detail.setdefault(kind, detail)

    def tell(self, contents: Contents, where: str) -> None:
        """Report the damage as faults."""
        for kind, count in self._count.items():
            detail = f"damaged MCAP: {'first: ' if count > 1 else ''}{self._detail[kind]}"
            contents.tell(kind, where, detail, count if kind in UNITS else None, UNITS.get(kind, ""))
