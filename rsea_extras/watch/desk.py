"""What pages ask for: commands, recordings and their evaluations, each in a child process; what they get."""

import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Protocol

from rsea_extras.watch.command import KINDS, Commander, Wish
from rsea_ros import RseaError
from rsea_ros.extension.base import ParameterError, start, stop, unused_path

VERBS = ("identify", "diagnose")
REPORT = "report.html"
_TAIL = 4000
"""Bytes of a process's words that are looked at."""


@dataclass
class Evaluation:
    """A verb on a recording. state: running, done or failed; words: the last line that it said."""

    folder: Path
    process: subprocess.Popen[bytes]
    log: IO[bytes]
    state: str = "running"
    words: str = ""

    def look(self) -> None:
        """Check whether it has ended, and read its output."""
        if self.state != "running":
            return
        status = self.process.poll()
        self.words = _line(self.log, first=status == 0)
        if status is not None:
            self.state = "done" if status == 0 and (self.folder / REPORT).is_file() else "failed"
            self.log.close()


@dataclass
class Recording:
    """A bag that is or was written. seconds: its length so far or in the end."""

    bag: Path
    process: subprocess.Popen[bytes] | None
    log: IO[bytes]
    began: float
    seconds: float = 0.0
    words: str = ""
    jobs: dict[str, Evaluation] = field(default_factory=dict)


class Runs:
    """The recordings of this start. folder: where they go.

    record_options: ROS arguments of the node that records. verb_options: of identify and diagnose.
    """

    def __init__(
        self, folder: Path, record_options: Sequence[str] = (), verb_options: Sequence[str] = ()
    ) -> None:
        self._folder, self._record_options, self._verb_options = folder, record_options, verb_options
        self._recordings: dict[str, Recording] = {}

    def record(self) -> None:
        """Start a recording. Raises ParameterError while one runs."""
        if any(r.process is not None for r in self._recordings.values()):
            raise ParameterError("a recording runs already")
        bag = unused_path(self._folder / time.strftime("%Y%m%d-%H%M%S"))
        words = ["-m", "rsea_ros.nodes.record", "--ros-args", *self._record_options, "-p", f"out:={bag}"]
        process, log = _python(words)
        self._recordings[bag.name] = Recording(bag, process, log, time.monotonic())

    def stop(self) -> None:
        """End the recording that runs: its bag is completed."""
        for each in self._recordings.values():
            if each.process is not None:
                each.process.send_signal(signal.SIGTERM)

    def evaluate(self, name: str, verb: str) -> None:
        """Do a verb with a recording. Raises ParameterError where it is not complete, and while one runs."""
        each = self._recordings.get(name)
        if each is None or each.process is not None or each.words:
            raise ParameterError(f"recording {name!r}, expected one that is complete")
        if verb not in VERBS:
            raise ParameterError(f"{verb!r}, expected one of {', '.join(VERBS)}")
        if any(job.state == "running" for r in self._recordings.values() for job in r.jobs.values()):
            raise ParameterError("another recording is being evaluated, expected one at a time")
        folder = unused_path(each.bag.with_name(f"{each.bag.name}-{verb}"))
        words = ["-m", "rsea_ros", verb, str(each.bag), "--out", str(folder), *self._verb_options]
        each.jobs[verb] = Evaluation(folder, *_python(words))

    def report(self, name: str, verb: str) -> Path | None:
        job = self._recordings[name].jobs.get(verb) if name in self._recordings else None
        return job.folder / REPORT if job is not None and job.state == "done" else None

    def look(self) -> Sequence[Mapping[str, Any]]:
        """Update the states, and return all recordings for the page, the newest first."""
        for each in self._recordings.values():
            _see_to(each)
            for job in each.jobs.values():
                job.look()
        return [_run_json(name, each) for name, each in reversed(self._recordings.items())]

    def close(self) -> None:
        """Complete the present recording, and end evaluations."""
        self.stop()
        jobs = [job.process for r in self._recordings.values() for job in r.jobs.values()]
        stop([*jobs, *(r.process for r in self._recordings.values() if r.process is not None)])


def _see_to(recording: Recording) -> None:
    if recording.process is None:
        return
    recording.seconds = time.monotonic() - recording.began
    status = recording.process.poll()
    if status is not None:
        recording.process = None
        complete = status == 0 and recording.bag.exists()
        recording.words = "" if complete else _line(recording.log) or "failed"
        recording.log.close()


def _run_json(name: str, r: Recording) -> Mapping[str, Any]:
    jobs = {verb: {"state": job.state, "words": job.words} for verb, job in r.jobs.items()}
    return {"name": name, "running": r.process is not None, "seconds": round(r.seconds, 1), "words": r.words,
            "jobs": jobs}  # fmt: skip


def _python(words: Sequence[str]) -> tuple[subprocess.Popen[bytes], IO[bytes]]:
    """Start a program of Python; return its process, and the file that its words go to."""
    log = tempfile.TemporaryFile()  # noqa: SIM115  it is read until the process has ended
    return start([sys.executable, *words], stdout=log, stderr=subprocess.STDOUT), log


def _line(log: IO[bytes], *, first: bool = False) -> str:
    """Return the last line with words, or the first."""
    size = log.seek(0, 2)
    log.seek(0 if first else max(0, size - _TAIL))
    text = log.read(_TAIL).decode(errors="replace")
    lines = [line.strip() for line in text.splitlines() if line.strip()] or [""]
    return lines[0 if first else -1]


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
                _stated(words, "recording"), _stated(words, "verb")
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
        size, frequency = (float(_stated(words, name, int | float)) for name in ("amplitude", "frequency"))
        wish = Wish(_stated(words, "kind"), size, frequency)
        if not self._commander.hold(page, wish, time.monotonic()):
            raise ParameterError("another page holds the command")

    def _release(self, page: Page) -> None:
        if self._commander is not None:
            self._commander.release(page)


def _stated(words: Mapping[str, Any], name: str, kind: Any = str) -> Any:
    value = words.get(name)
    if not isinstance(value, kind):
        raise ParameterError(f"{name} = {value!r}, expected a {'text' if kind is str else 'number'}")
    return value
