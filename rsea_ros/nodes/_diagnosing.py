"""A diagnosis in a separate thread, while the node goes on."""

from __future__ import annotations

from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path

from msg_adapters.records import write_overlay
from rsea_ros.checks.carried import check_diagnosable
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.documents.units import with_unit
from rsea_ros.errors import RseaError
from rsea_ros.model.rig import Rig
from rsea_ros.nodes._health import OK, WARN, NodeHealth
from rsea_ros.outputs.new_files import Destination
from rsea_ros.records.record import Record
from rsea_ros.report.diagnosis.words import diagnosis_sentence
from rsea_ros.report.remark_words import fault_lines
from rsea_ros.report.result_files import REPORT

_POLL = 0.02
"""s that the executor rests between two looks at a thread that still works."""


class Diagnosing:
    """At most one diagnosis at a time; its files go to `out`, those of a second to out-2."""

    def __init__(self, rig: Rig, out: Path) -> None:
        self._rig, self._out = rig, out
        self._pool = ThreadPoolExecutor(1, "diagnosis")
        self._work: Future[Diagnosis] | None = None
        self._step, self._stopped = "", False
        self._report = out / REPORT

    @property
    def busy(self) -> bool:
        """Whether a diagnosis is under way."""
        return self._work is not None and not self._work.done()

    def begin(self, record: Record) -> AwaitableResult:
        """Start on a record and return an awaitable.

        Raises RseaError for a record that cannot be diagnosed, and while a diagnosis is under way.
        """
        if self.busy:
            raise RseaError(f"a diagnosis is under way ({self._step}), expected its end first")
        check_diagnosable(record)
        self._work = self._pool.submit(self._diagnose, record)
        return AwaitableResult(self._work)

    def report(self) -> NodeHealth | None:
        """Return the status for /diagnostics: the step, then the verdict; None before the first diagnosis."""
        if self._work is None:
            return None
        if not self._work.done():
            return NodeHealth(OK, f"diagnosing: {self._step}", {})
        if error := self._work.exception():
            return NodeHealth(WARN, f"diagnosis failed: {error}", {})
        return report_of(self._work.result(), self._report)

    def close(self) -> None:
        """Stop at the next step and wait for that."""
        self._stopped = True
        self._pool.shutdown()

    def _diagnose(self, record: Record) -> Diagnosis:
        from rsea_ros.checks.carried import with_check_faults
        from rsea_ros.diagnosis.diagnose import diagnose
        from rsea_ros.report.diagnosis.files import write_diagnosis

        result = diagnose([with_check_faults(record, self._rig, masks=True)], self._rig, progress=self._tell)
        self._report = write_diagnosis(result, record, Destination(self._out, fresh=True), write_overlay)
        return result

    def _tell(self, step: str, share: float) -> None:
        if self._stopped:
            raise RseaError("the node is closing")
        self._step = step


class AwaitableResult:
    """Await a thread's result in a coroutine of rclpy's executor, which resumes it over and over."""

    def __init__(self, work: Future[Diagnosis]) -> None:
        self._work = work

    def __await__(self) -> Generator[None, None, Diagnosis]:
        """Pause repeatedly and let the executor work until the thread is done."""
        while not self._work.done():
            wait([self._work], _POLL)
            yield
        return self._work.result()


def report_of(diagnosis: Diagnosis, report: Path) -> NodeHealth:
    """Return verdict, causes with sizes and gains, and faults of the data as the values of a diagnostic."""
    values: dict[str, object] = {
        "verdict": diagnosis.verdict,
        "causes": ", ".join(c.name for c in diagnosis.causes),
    }
    for cause in diagnosis.causes:
        sizes = {name: with_unit(f"{p.value:.6g}", p.unit) for name, p in cause.parameters.items()}
        values |= {f"{cause.name}.{name}": size for name, size in sizes.items()}
        values[f"{cause.name}.gain"] = f"{cause.gain_holdout:.4f}"
        values[f"{cause.name}.status"] = cause.status
        values[f"{cause.name}.probability"] = f"{cause.probability:.2f}"
    values["faults"] = "; ".join(fault_lines(diagnosis.faults))
    level = OK if diagnosis.verdict == "nothing_wrong" and not diagnosis.faults else WARN
    return NodeHealth(level, diagnosis_sentence(diagnosis), {**values, "report": report})
