"""The requests of pages (commands, recordings, evaluations), and the frames and state sent to them."""

import json
import time
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from rsea_ros.errors import ParameterError, RseaError
from rsea_ros.watch.command import KINDS, Commander, Wish
from rsea_ros.watch.runs import Runs

MOST_WAITING = 10
"""Frames that a slow connection may be behind; further ones it does not get."""
MOST_PAGES = 8


class Page(Protocol):
    """A page that is open somewhere. waiting: messages that are not out yet."""

    waiting: int

    def send(self, text: str) -> None:
        """Send a text."""


class Desk:
    """The open pages and their rights. commander: None where pages may only look."""

    def __init__(self, commander: Commander | None, runs: Runs) -> None:
        self._commander, self._runs = commander, runs
        self._pages: set[Page] = set()
        self.why_not: Callable[[], str] = lambda: ""
        self._acts: Mapping[str, Callable[[Page, Mapping[str, Any]], None]] = {
            "hold": self._hold,
            "release": lambda page, words: self._release(page),
            "record": lambda page, words: self._runs.record(),
            "stop": lambda page, words: self._runs.stop(),
            "evaluate": lambda page, words: self._runs.evaluate(
                _text(words, "recording"), _text(words, "verb")
            ),
        }

    @property
    def count(self) -> int:
        return len(self._pages)

    def enter(self, page: Page) -> bool:
        if len(self._pages) >= MOST_PAGES:
            return False
        self._pages.add(page)
        return True

    def leave(self, page: Page) -> None:
        self._release(page)
        self._pages.discard(page)

    def leave_all(self) -> None:
        for page in list(self._pages):
            self.leave(page)

    def act(self, page: Page, message: str | bytes) -> None:
        """Execute the request of a page, and report if it cannot be done."""
        try:
            words = json.loads(message)
            if not isinstance(words, dict) or words.get("do") not in self._acts:
                raise ParameterError(f"message, expected do: one of {', '.join(self._acts)}")
            self._acts[words["do"]](page, words)
        except (RseaError, ValueError, OSError) as error:
            page.send(json.dumps({"error": " ".join(str(error).split())}))

    def state(self, more: Mapping[str, Any]) -> str:
        """Return the state as JSON; more: the state of the source."""
        held = self._commander is not None and self._commander.holder is not None
        bounds = self._commander.bounds if self._commander is not None else None
        command = None if self._commander is None else {
            "held": held, "kinds": KINDS, "limit": None if bounds is None else bounds.torque,
            "why_not": self.why_not(),
        }  # fmt: skip
        return json.dumps({"state": {**more, "command": command, "recordings": self._runs.look()}})

    def send(self, *texts: str | None) -> None:
        for page in list(self._pages):
            for text in texts:
                if text is not None and page.waiting < MOST_WAITING:
                    page.send(text)

    def _hold(self, page: Page, words: Mapping[str, Any]) -> None:
        if self._commander is None:
            raise ParameterError("this page may only look; rsea watch --command lets it command")
        if reason := self.why_not():
            raise ParameterError(reason)
        wish = Wish(_text(words, "kind"), _number(words, "amplitude"), _number(words, "frequency"))
        if not self._commander.hold(page, wish, time.monotonic()):
            raise ParameterError("another page holds the command")

    def _release(self, page: Page) -> None:
        if self._commander is not None:
            self._commander.release(page)


def _number(words: Mapping[str, Any], name: str) -> float:
    value = words.get(name)
    if not isinstance(value, int | float):
        raise ParameterError(f"{name} = {value!r}, expected a number")
    return float(value)


def _text(words: Mapping[str, Any], name: str) -> str:
    value = words.get(name)
    if not isinstance(value, str):
        raise ParameterError(f"{name} = {value!r}, expected a text")
    return value
