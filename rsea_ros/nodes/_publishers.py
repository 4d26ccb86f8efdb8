"""One publisher of commands at a time: of two the first is obeyed, until it is silent."""

from __future__ import annotations

from rsea_ros.nodes._commands import HORIZON


class Obeyed:
    """ignored: messages of others while the one that is obeyed went on."""

    def __init__(self) -> None:
        self._who: object = None
        self._heard = 0
        self.ignored = 0

    def admit(self, who: object, now: int) -> bool:
        """Return whether a message of a publisher (by identity) counts. now: ns, of a clock without steps."""
        if who != self._who and self._who is not None and now - self._heard < HORIZON:
            self.ignored += 1
            return False
        self._who, self._heard = who, now
        return True
