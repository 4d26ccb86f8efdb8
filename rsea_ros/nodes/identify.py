"""identify: records the topics and identifies the actuator, as `rsea identify` does.

~/diagnose treats the recording as `rsea diagnose` treats a bag.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from msg_adapters.records import write_overlay
from msg_adapters.ros import Trigger
from msg_adapters.topic_map import ROLES
from rsea_ros.checks.carried import check_diagnosable, with_check_faults
from rsea_ros.diagnosis.result import Diagnosis
from rsea_ros.documents.units import with_unit
from rsea_ros.errors import RseaError
from rsea_ros.identification.result import Identification
from rsea_ros.model.rig import Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._health import OK, WARN, Health, NodeHealth
from rsea_ros.nodes._parameters import AXIS, NodeParameter
from rsea_ros.nodes._run import Component
from rsea_ros.nodes._tap import Ears, heard
from rsea_ros.outputs.files import Destination, check_free, unused_path
from rsea_ros.records.record import Record
from rsea_ros.report.diagnosis.words import diagnosis_sentence
from rsea_ros.report.identification import verdict_sentence, write_results
from rsea_ros.report.remark_words import fault_lines
from rsea_ros.report.result_files import IDENTIFICATION, REPORT

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
        return diagnosis_report(self._work.result(), self._report)

    def close(self) -> None:
        """Stop at the next step and wait for that."""
        self._stopped = True
        self._pool.shutdown()

    def _diagnose(self, record: Record) -> Diagnosis:
        from rsea_ros.diagnosis.diagnose import diagnose
        from rsea_ros.report.diagnosis.page import write_diagnosis

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


def diagnosis_report(diagnosis: Diagnosis, report: Path) -> NodeHealth:
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


DEFAULT = "out/identify"
TABLE = (
    NodeParameter("rig", "paper_high_impedance", "where the fit starts: a name of config/rigs, or a file"),
    NodeParameter(
        "out", DEFAULT, "directory of the results; the default: the first of -2, -3, … that is new"
    ),
    AXIS,
    NodeParameter(
        "quiet", 1.0, "finish so long after the last command, once nobody publishes any", "s", 0.1, 1e3
    ),
    NodeParameter(
        "stay", False, "wait for ~/finish also when the commands are over, so that ~/diagnose can be asked"
    ),
    NodeParameter("reliable", False, "lose nothing; needs reliable publishers, as replay's are"),
)


class IdentifyNode:
    """Records the topics of a bench; the identification begins when the commands are over.

    They are over when some have come, none has for `quiet` seconds, and torque_command has no publisher any
    more (the replay or the excitation has ended), or when ~/finish is called; with `stay` only then. A
    running diagnosis is completed first.
    """

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        self._node, self._values = node, values
        self._rig = load_rig(values["rig"])
        self._commanded, self._asked, self._done = 0.0, False, False
        self._ears = Ears(node, values["axis"], ROLES if values["reliable"] else (), self._heard)
        self._service = node.create_service(Trigger, "~/finish", self._on_finish)
        self._out = unused_path(Path(DEFAULT)) if values["out"] == DEFAULT else Path(values["out"])
        check_free(self._out / name for name in IDENTIFICATION)
        self._diagnosing = Diagnosing(self._rig, self._out / "diagnosis")
        self._answering = 0
        self._identified: NodeHealth | None = None
        group = ReentrantCallbackGroup()
        self._diagnose = node.create_service(Trigger, "~/diagnose", self._on_diagnose, callback_group=group)
        self._health = Health(node, self._report)
        node.create_timer(1.0, self._tell)

    def _heard(self, role: str) -> None:
        if role == "torque_command":
            self._commanded = time.monotonic()

    def _on_finish(self, request: Any, response: Any) -> Any:
        self._asked = True
        response.success, response.message = True, f"identifying from {self._progress_text()}"
        return response

    async def _on_diagnose(self, request: Any, response: Any) -> Any:
        """Answer with the verdict in a sentence, once it is known; other callbacks run meanwhile."""
        self._answering += 1
        try:
            diagnosis = await self._diagnosing.begin(self._ears.record(strict=False))
            response.success, response.message = True, diagnosis_sentence(diagnosis)
        except (RseaError, OSError) as error:
            response.success, response.message = False, " ".join(str(error).split())
        finally:
            self._answering -= 1
        self._node.get_logger().info(response.message)
        self._health.publish()
        return response

    def is_finished(self) -> bool:
        """Return whether the commands are over and every diagnosis has been answered."""
        waited = self._commanded > 0.0 and time.monotonic() - self._commanded > self._values["quiet"]
        over = waited and not self._node.count_publishers(self._ears.topics.topic("torque_command"))
        self._done = (self._asked or (over and not self._values["stay"])) and not self._answering
        return self._done

    def conclude(self) -> None:
        """Identify and write the results, or do nothing when stopped before."""
        from rsea_ros.identification.identify import identify

        if not self._done:
            return
        log = self._node.get_logger()
        log.info(f"identifying from {self._progress_text()}")
        record = self._ears.record(strict=True)
        record = with_check_faults(record, self._rig, self._values["axis"], masks=False)
        result = identify([record], self._rig, self._progress)
        report = write_results(result, self._out)
        self._identified = report_of(result, report)
        self._health.publish()
        log.info(self._identified.summary)
        for line in fault_lines(result.faults):
            log.warning(f"data: {line}")
        for p in result.parameters:
            size = with_unit(f"{p.value:.6g}", p.unit)
            log.info(f"{p.name} = {size}, 95 %: {p.ci95[0]:.6g} to {p.ci95[1]:.6g}")
        log.info(f"report: {report}")

    def _progress(self, step: str, share: float) -> None:
        self._node.get_logger().info(f"{share:.0%} {step}")

    def close(self) -> None:
        """Leave nothing behind."""
        self._diagnosing.close()

    def _progress_text(self) -> str:
        words, _, lost = heard(self._ears.taps)
        return f"{words}, {lost} lost"

    def _tell(self) -> None:
        log = self._node.get_logger()
        if self._commanded:
            log.info(self._progress_text())
        else:
            log.info("waiting for torque_command", throttle_duration_sec=10.0)

    def _report(self) -> NodeHealth:
        if self._identified is not None:
            return self._identified
        lost = sum(tap.lost for tap in self._ears.taps.values())
        counts = {role: tap.count for role, tap in self._ears.taps.items()}
        if (diagnosis := self._diagnosing.report()) is not None:
            return NodeHealth(diagnosis.level, diagnosis.summary, {**counts, **diagnosis.values})
        return NodeHealth(WARN if lost else OK, f"{lost} messages lost" if lost else "gathering", counts)


def report_of(result: Identification, report: Path) -> NodeHealth:
    """Return verdict, parameters and faults of the data as the values of a diagnostic."""
    values: dict[str, object] = {"verdict": result.verdict, "faults": "; ".join(fault_lines(result.faults))}
    values |= {p.name: with_unit(f"{p.value:.6g}", p.unit) for p in result.parameters}
    level = OK if result.verdict == "adequate" and not result.faults else WARN
    return NodeHealth(level, verdict_sentence(result), {**values, "report": report})


NODE = Component("identify", TABLE, IdentifyNode, endless=False)
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
