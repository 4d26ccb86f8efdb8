"""experiment: separates the possible causes of a bench, run by run, each with a person's consent.

It begins with earlier recordings (`bag`). ~/approve plays the proposed run,
~/decline ends the session, ~/cancel stops a run softly at any sample. The results are on /diagnostics.
"""

import threading
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.node import Node

from msg_adapters import read_record, write_record
from msg_adapters.records import write_overlay
from msg_adapters.ros import JointState, Trigger
from rsea_ros.errors import DeviceError, ParameterError, RseaError
from rsea_ros.experiment.campaign import Budget, Campaign, CampaignOutcome, Round
from rsea_ros.experiment.joint_weighing import USUAL, causes_from, diagnose_together
from rsea_ros.experiment.proposal import LONGEST, RATES, DesignRequest, Proposal
from rsea_ros.experiment.run_shape import limits_from
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._health import OK, STEADY, WARN, Health, NodeHealth
from rsea_ros.nodes._parameters import AXIS, JOINT, NodeParameter
from rsea_ros.nodes._player import BenchEars, BenchStatus, LiveRun, Player
from rsea_ros.nodes._qos import COMMAND
from rsea_ros.nodes._run import Component
from rsea_ros.outputs.files import Destination, unused_path
from rsea_ros.records.record import Record
from rsea_ros.report import experiment as words
from rsea_ros.report.diagnosis.page import write_diagnosis
from rsea_ros.report.diagnosis.words import diagnosis_sentence

DEFAULT = "out/experiment"
TABLE = (
    NodeParameter("rig", "paper_high_impedance", "what the bench is: a name of config/rigs, or a file"),
    NodeParameter("bag", "", "what was recorded so far, commas between several bags"),
    NodeParameter("causes", ",".join(USUAL), "effects of the catalogue that it may be, commas between them"),
    NodeParameter("limits", "torque=10", "of every run, as in rsea experiment --limits"),
    NodeParameter("seconds", 60.0, "budget of excitation", "s", 0.5, 1e5),
    NodeParameter("energy", 1e6, "budget of the integral of the squared torque", "N^2 m^2 s", 1.0, 1e12),
    NodeParameter("shortest", 0.5, "length of a run at least, with its soft ends", "s", 0.01, LONGEST),
    NodeParameter("longest", 10.0, "length of a run at most", "s", 0.5, LONGEST),
    NodeParameter("per_run", 0.5, "excitation as dear as one more run; 0: least excitation", "s", 0.0, 600.0),
    NodeParameter("rate", 280.0, "commands a second", "Hz", *RATES),
    NodeParameter("ask", True, "wait for ~/approve before each run; false: play at once"),
    NodeParameter(
        "approval", 10.0, "in which an approved run begins, or is to be approved again", "s", 0.1, 600.0
    ),
    NodeParameter("lead", 0.1, "how long before it takes effect a command is published", "s", 0.0, 0.2),
    NodeParameter(
        "out", DEFAULT, "directory of the results; the default: the first of -2, -3, … that is new"
    ),
    AXIS,
    JOINT,
)


class ExperimentNode:
    """The loop in a separate thread; the executor's thread plays and records."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        self._node, self._values = node, values
        self._out = unused_path(Path(DEFAULT)) if values["out"] == DEFAULT else Path(values["out"])
        words.check_session_free(self._out)
        self._publisher = node.create_publisher(JointState, "torque_command", COMMAND)
        self._ears = BenchEars(node, values["axis"])
        self._bench = BenchStatus(node, values["joint"])
        self._trial: LiveRun | None = None
        self._proposal: Proposal | None = None
        self._round: Round | None = None
        self._answer: bool | None = None
        self._cancelled = ""
        self._changed = threading.Condition()
        self._campaign = self._make(values)
        self._runs = 0
        for name, answer in (
            ("approve", partial(self._take_answer, True)),
            ("decline", partial(self._take_answer, False)),
            ("cancel", self._cancel),
        ):
            node.create_service(Trigger, f"~/{name}", answer)
        self._health = Health(node, self._report)
        node.create_timer(0.02, self._look, clock=STEADY)
        self._pool = ThreadPoolExecutor(1, "experiment")
        self._work: Future[CampaignOutcome] = self._pool.submit(self._go)

    def _make(self, values: dict[str, Any]) -> Campaign:
        shortest, longest, per_run = (values[n] for n in ("shortest", "longest", "per_run"))
        limits = limits_from(values["limits"])
        asked = DesignRequest(limits, values["rate"], min(shortest, longest), longest, per_run=per_run)
        budget = Budget(values["seconds"], values["energy"])
        causes = causes_from(values["causes"])
        return Campaign(load_rig(values["rig"]), causes, asked, self._play, budget, hear=self._hear)

    def _go(self) -> CampaignOutcome:
        """Begin with the bags. Raises ParameterError without one, BagError for one that cannot be read."""
        bags = [bag for bag in self._values["bag"].split(",") if bag]
        if not bags:
            raise ParameterError("bag = '', expected what was recorded so far (rsea run record)")
        return self._campaign.go([read_record(bag, strict=False) for bag in bags])

    def _hear(self, round_: Round) -> None:
        self._round = round_
        log = self._node.get_logger()
        log.info(words.known_causes(round_.weighing))
        run = round_.proposal
        assert run is not None
        log.info(f"proposed: {words.shape_words(run)}; {run.resolved:.0%} expected to be decided")

    def _play(self, proposal: Proposal) -> Record | None:
        """In the loop's thread: request approval, play the run, return its record; None if declined."""
        with self._changed:
            self._proposal, self._answer = proposal, None if self._values["ask"] else True
            self._changed.wait_for(self._is_answered)
            self._proposal, trial, self._trial = None, self._trial, None
        if trial is None:
            return None
        record = trial.record()
        self._runs += 1
        write_record(record, self._out / f"run-{self._runs}.mcap")
        return record

    def _is_answered(self) -> bool:
        """Return whether the proposed run is over, or will not be played."""
        refused = self._answer is False or (bool(self._cancelled) and self._trial is None)
        return self._proposal is None or refused

    def _look(self) -> None:
        """In the executor: begin an approved run, end one that is over or whose approval has expired."""
        with self._changed:
            if self._proposal is None or not self._answer or self._is_answered():
                return
            if self._trial is None:
                self._trial = LiveRun(self._ears, self._player(self._proposal))
            elif self._values["ask"] and self._trial.waits() > self._values["approval"]:
                self._trial.close()
                self._trial = self._answer = None
                why = self._bench.idle or "no bench"
                text = f"{why} within {self._values['approval']:g} s: the approval has expired"
                self._node.get_logger().warning(text)
            elif self._trial.over():
                self._trial.close()
                self._proposal = None
                self._changed.notify_all()

    def _player(self, proposal: Proposal) -> Player:
        options = {name: self._values[name] for name in ("lead", "joint")}
        self._bench.largest = float(abs(proposal.command).max())
        plan = self._node, proposal.command, proposal.rate, self._bench
        return Player(*plan, wanted=2, publisher=self._publisher, **options)

    def _take_answer(self, answer: bool, request: Any, response: Any) -> Any:
        with self._changed:
            waits = self._proposal is not None and self._answer is None
            if waits:
                assert self._proposal is not None
                self._answer = answer
                outcome = f"{'plays' if answer else 'does not play'}: {words.shape_words(self._proposal)}"
                self._changed.notify_all()
            response.success, response.message = waits, outcome if waits else "no run waits for an answer"
        return response

    def _cancel(self, request: Any, response: Any) -> Any:
        with self._changed:
            self._cancelled = "cancelled by ~/cancel"
            if self._trial is not None:
                self._trial.stop(self._cancelled)
            self._changed.notify_all()
        response.success = True
        response.message = "goes softly to zero torque; nothing is learnt from this run"
        return response

    def is_finished(self) -> bool:
        """Return whether the loop has ended."""
        return self._work.done()

    def conclude(self) -> None:
        """Write the results, if the loop has ended by itself."""
        if not self._work.done():
            return
        outcome = self._work.result()
        log = self._node.get_logger()
        log.info(words.end_sentence(outcome))
        report = words.write_campaign(outcome, self._campaign, self._out)
        self._health.publish()
        if outcome.seconds:
            log.info(f"diagnosis of all runs: {self._diagnose(outcome)}")
        log.info(f"report: {report}")

    def _diagnose(self, outcome: CampaignOutcome) -> str:
        """Write the diagnosis of all runs together and return its sentence; a person may interrupt it."""
        try:
            verdict = diagnose_together(outcome.records, self._campaign.rig, self._campaign.causes)
            write_diagnosis(
                verdict, outcome.records[-1], Destination(self._out / "diagnosis", fresh=True), write_overlay
            )
        except RseaError as error:
            return f"none: {' '.join(str(error).split())}"
        return diagnosis_sentence(verdict)

    def close(self) -> None:
        """Zero torque first; then let the loop's thread end."""
        with self._changed:
            self._cancelled = self._cancelled or "the node is closing"
            if self._trial is not None and self._proposal is not None:
                self._trial.stop(self._cancelled)
                self._trial.close()
                self._proposal = None
            self._changed.notify_all()
        self._campaign.tell = _end
        self._pool.shutdown(cancel_futures=True)

    def _report(self) -> NodeHealth:
        if self._work.done() and not self._work.cancelled() and self._work.exception() is None:
            outcome = self._work.result()
            level = OK if outcome.end in ("confirmed", "nothing_wrong") else WARN
            return NodeHealth(level, words.end_sentence(outcome), outcome.weighing.probability)
        waits = self._proposal is not None and self._answer is None
        state = "waits for ~/approve" if waits else "plays" if self._trial is not None else "designs"
        values: dict[str, object] = {"runs": self._runs}
        if self._proposal is not None:
            values["run"] = words.shape_words(self._proposal)
        if self._round is not None:
            values |= {n: f"{p:.3f}" for n, p in self._round.weighing.probability.items()}
        return NodeHealth(OK, state, values)


def _end(step: str, share: float) -> None:
    raise DeviceError("the node is closing")


NODE = Component("experiment", TABLE, ExperimentNode, endless=False)
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
