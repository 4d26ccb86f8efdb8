"""A fork server, whose children call `main()` with ceilings of memory and time, and the outcome of each.

This process has run every verb once and forks once for each piece of work.
"""

import contextlib
import importlib
import json
import os
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rsea_ros.cli.main import FAULT, main
from rsea_ros.effects.catalogue import catalogue

RIG = "paper_high_impedance"
WALL = 1200
"""s after which a child that neither computes nor ends is ended."""
MODULES = (
    "rsea_ros.cli.identify", "rsea_ros.cli.diagnose", "rsea_ros.cli.predict", "rsea_ros.cli.simulate",
    "rsea_ros.cli.control", "rsea_ros.cli.design", "rsea_ros.cli.export", "rsea_ros.cli.import_",
    "rsea_ros.cli.check", "rsea_ros.report.diagnosis.page", "rsea_ros.report.identification",
    "rsea_ros.report.control", "rsea_ros.report.design", "rsea_ros.design.mujoco_model",
    "msg_adapters.records", "scipy.interpolate", "scipy.signal", "scipy.io", "rich.console", "rich.table",
)  # fmt: skip
FIRST = (
    ["simulate", RIG, "--out", "DIR/bag.mcap", "--duration", "5"],
    ["check", "DIR/bag.mcap", "--rig", RIG],
    ["identify", "DIR/bag.mcap", "--rig", RIG, "--out", "DIR/identified"],
    ["diagnose", "DIR/bag.mcap", "--rig", RIG, "--out", "DIR/diagnosed"],
    ["predict", RIG, "DIR/bag.mcap", "--out", "DIR/predicted.csv", "--json"],
    ["design", "--out", "DIR/design"],
)  # fmt: skip
"""Verbs that are run once before all others."""
MEMORY = 1_500 * 1024**2
"""Bytes of private writable memory (RLIMIT_DATA): address space alone says nothing with compiled code."""
SPARE = 256 * 1024**2
SECONDS = 60
"""s on a machine of two cores that does nothing else, counted in processor time: others do not change it."""
TWO_CORES = ("diagnose",)
"""Verbs that keep both cores busy: their time is twice as long in processor time."""
RESULT, REFUSED = "result", "refused"
TOLERATED = (0, 1)
"""Exit statuses of a result: done, and a finding that was asked for by status."""
FAULTS = ("traceback", "warning", "time-out", "memory", "crash", "last net", "message", "json", "gate")


@dataclass
class Outcome:
    """kind: result, refused, or one of FAULTS. where: the place in the code, or the message's pattern."""

    kind: str
    where: str = ""
    detail: str = ""
    seconds: float = 0.0
    megabytes: float = 0.0
    warned: list[str] = field(default_factory=list)

    @property
    def is_fault(self) -> bool:
        """Whether the promise was broken."""
        return self.kind in FAULTS


Play = Callable[[Path, bytes, int], Outcome]
"""Reads the bytes of a file in a folder, the n-th of its format."""
Work = Callable[[Path], Iterator[tuple[str, Callable[[], Outcome]]]]
"""In a folder of its own: yields names, and what gives the outcome of each."""


def limit_child(verb: str = "", seconds: int = SECONDS) -> None:
    """Put the ceilings on this process, of processor time counted from now. verb: the one that it runs."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    cpu = int(used.ru_utime + used.ru_stime) + seconds * (2 if verb in TWO_CORES else 1)
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, resource.getrlimit(resource.RLIMIT_CPU)[1]))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY + SPARE))


def failed(error: BaseException) -> Outcome:
    """Return the outcome of a call that ended by an error; its memory is freed to write that down."""
    if isinstance(error, MemoryError):
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY + SPARE, MEMORY + SPARE))
        return Outcome("memory", place(error), repr(error)[:300])
    return Outcome("traceback", place(error), "".join(traceback.format_exception(error))[-3000:])


def call(arguments: list[str]) -> Outcome:
    """Run `rsea ARGUMENTS` in this process and judge status and output."""
    warned: list[str] = []
    os.environ["RSEA_TRACEBACK"] = "1"

    def note(message, category, filename, lineno, file=None, line=None):  # type: ignore[no-untyped-def]
        if issubclass(category, RuntimeWarning):
            warned.append(f"{_at(traceback.extract_stack()) or f'{_short(filename)}:{lineno}'} {message}")

    with warnings.catch_warnings(), capture() as (out, err):
        warnings.simplefilter("always")
        warnings.showwarning = note
        try:
            status: int | str | None = main(arguments)
        except SystemExit as error:
            status = error.code
        except BaseException as error:
            return failed(error)
    outcome = judge(status, read(out), read(err), "--json" in arguments)
    outcome.warned = sorted(set(warned))
    if warned and not outcome.is_fault:
        outcome.kind, outcome.where = "warning", outcome.warned[0]
    return outcome


@contextlib.contextmanager
def capture() -> Iterator[tuple[int, int]]:
    """Redirect stdout and stderr to files, for libraries in C too; yield the descriptors of the files."""
    kept, files = [os.dup(1), os.dup(2)], [os.memfd_create("out"), os.memfd_create("err")]
    sys.stdout.flush()
    sys.stderr.flush()
    for number, file in zip((1, 2), files, strict=True):
        os.dup2(file, number)
    streams = [open(n, "w", encoding="utf-8", closefd=False) for n in (1, 2)]  # noqa: SIM115
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        try:
            yield files[0], files[1]
        finally:
            for number, stream, old in zip((1, 2), streams, kept, strict=True):
                stream.flush()
                os.dup2(old, number)
                os.close(old)


def read(file: int) -> str:
    """Return the text of a captured stream."""
    os.lseek(file, 0, os.SEEK_SET)
    with open(file, encoding="utf-8", errors="replace") as stream:
        return stream.read()


def judge(status: int | str | None, out: str, err: str, is_json: bool) -> Outcome:
    """Hold status and output to the promise: a result, or status 2 and one line that says what is wrong."""
    lines = err.strip().splitlines()
    last = lines[-1] if lines else ""
    if FAULT in err:
        return Outcome("last net", _pattern(last), err[-3000:])
    if "Traceback" in err:
        return Outcome("traceback", last, err[-3000:])
    if status in TOLERATED:
        return _result(out, err, is_json)
    if status != 2:
        return Outcome("message", f"status {status}", err[-300:])
    message = last.partition(": ")[2].strip()
    if not message or not last.startswith("rsea") or (len(lines) > 1 and not err.startswith("usage:")):
        return Outcome("message", "not one line that says what is wrong", err[-600:])
    return Outcome(REFUSED, "", last)


def _result(out: str, err: str, is_json: bool) -> Outcome:
    if is_json:
        try:
            json.loads(out, parse_constant=_no_constant)
        except ValueError as error:
            return Outcome("json", str(error), out[-300:])
    if err.strip():
        return Outcome("warning", f"on stderr: {_pattern(err.strip().splitlines()[0])}", err[-600:])
    return Outcome(RESULT, "", (out.strip().splitlines() or [""])[0])


def _no_constant(name: str) -> float:
    raise ValueError(f"{name} is no JSON")


def place(error: BaseException) -> str:
    """Return type, the innermost line of the project, and the text, for counting equal ones together."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "bench" not in f.filename]
    return f"{type(error).__name__} at {_at(frames) or '?'}: {_pattern(str(error)[:80])}"


def _at(frames: Sequence[traceback.FrameSummary]) -> str:
    """Return the innermost line of the project, '' where none is in it."""
    inside = [f for f in frames if "rsea_ros" in f.filename or "msg_adapters" in f.filename]
    return f"{_short(inside[-1].filename)}:{inside[-1].lineno} {inside[-1].name}" if inside else ""


def _short(filename: str) -> str:
    return "/".join(Path(filename).parts[-2:])


def _pattern(message: str) -> str:
    return re.sub(r"\b[0-9][0-9a-fx.e+-]*|'[^']*'", "#", message)[:160]


def outcome_of_end(status: int, usage: resource.struct_rusage) -> Outcome:
    """Return the outcome of a child that ended without an answer."""
    outcome = Outcome("crash", f"ended with status {os.waitstatus_to_exitcode(status)} without an answer")
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        kind = {signal.SIGXCPU: "time-out", signal.SIGKILL: "memory"}.get(number, "crash")
        outcome = Outcome(kind, f"ended by {signal.Signals(number).name}")
    outcome.seconds, outcome.megabytes = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024
    return outcome


def warm() -> None:
    """Import all modules of the verbs and run the verbs, so that no child has to load code."""
    for name in MODULES:
        importlib.import_module(name)
    catalogue()
    with tempfile.TemporaryDirectory(prefix="rsea-warm-") as folder:
        for words in FIRST:
            call([word.replace("DIR", folder) for word in words])


def serve(works: Iterable[Work], folder: Path, jobs: int) -> Iterator[tuple[str, Outcome]]:
    """Do the works in at most `jobs` children at a time; yield name and outcome of each part as they end."""
    running: dict[int, Path] = {}
    for number, work in enumerate(works):
        if len(running) >= jobs:
            yield from _end(running)
        inside = folder / str(number)
        inside.mkdir()
        running[_fork(work, inside)] = inside
    while running:
        yield from _end(running)


def _fork(work: Work, inside: Path) -> int:
    """Start a child that writes each name and then its outcome to a file; return its process id."""
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid:
        return pid
    status = 70
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.alarm(WALL)
        with (inside / "log").open("w", encoding="utf-8", buffering=1) as file:
            for name, part in work(inside):
                file.write(json.dumps(name) + "\n")
                file.write(json.dumps(asdict(_judged(part))) + "\n")
        status = 0
    finally:
        os._exit(status)


def _judged(part: Callable[[], Outcome]) -> Outcome:
    """Return the outcome of a part; an error of the bench's own is one too."""
    began = time.process_time()
    try:
        outcome = part()
    except Exception:
        text = traceback.format_exc()
        outcome = Outcome("gate", text.splitlines()[-1], text[-3000:])
    outcome.seconds = time.process_time() - began
    outcome.megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return outcome


def _end(running: dict[int, Path]) -> Iterator[tuple[str, Outcome]]:
    """Wait until a child ends, and yield what it has left; the part at which it broke off has its end."""
    pid, status, usage = os.wait4(-1, 0)
    lines = [json.loads(line) for line in (running.pop(pid) / "log").read_text("utf-8").splitlines()]
    for name, outcome in zip(lines[::2], lines[1::2], strict=False):
        yield name, Outcome(**outcome)
    if status:
        yield lines[-1] if len(lines) % 2 else "the bench itself", outcome_of_end(status, usage)
