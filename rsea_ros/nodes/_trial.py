"""One run on the live graph: played, recorded, and valid only without a failure."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from rclpy.node import Node

from msg_adapters import TopicMap
from msg_adapters.contents import Contents
from msg_adapters.reading import record_from
from msg_adapters.ros import ERROR, DiagnosticArray, message_type
from msg_adapters.topic_map import ROLES, TYPES
from rsea_ros.errors import DeviceError, RseaError
from rsea_ros.experiment.joint_weighing import SHORTEST
from rsea_ros.nodes._player import Player
from rsea_ros.nodes._qos import COMMAND, RECORD, RECORD_RELIABLE
from rsea_ros.nodes._tap import Tap
from rsea_ros.records.record import Record

BROKEN = {"commands_left_out", "late_commands", "lost_messages", "watchdog_trips"}
"""Faults of a record that say that its commands did not act as planned."""
SILENT = 0.3
"""s without a measurement after which a run is stopped: nobody knows what the bench does."""
FOLLOWED = 0.5
"""RMS of measured less commanded torque, of the command's, above which the motor did not follow."""
_TAIL = 0.5
"""s that is heard after the last command, beside what makes the record long enough for a diagnosis."""


class Ears:
    """The topics of a node's bench while it lives, with a new record for each run."""

    def __init__(self, node: Node, axis: str) -> None:
        self._axis = axis
        self._contents, self._names = Contents(), dict[str, str]()
        self._alarm: Callable[[str], None] = lambda why: None
        self.last = time.monotonic()
        self._failed: set[str] = set()
        self._taps = {role: self._tap(node, role) for role in ROLES}
        self._health = node.create_subscription(DiagnosticArray, "/diagnostics", self._on_health, COMMAND)

    def begin(self, alarm: Callable[[str], None]) -> None:
        """Start a new record. alarm: called when a node of the bench has failed."""
        self._contents, self._alarm, self.last = Contents(), alarm, time.monotonic()

    def record(self) -> Record:
        """Return the record since then. Raises RseaError where none can be made."""
        topics = TopicMap(**self._names, axis=self._axis)
        return record_from(self._contents, self._names["torque_command"], topics, strict=False)

    def _tap(self, node: Node, role: str) -> Tap:
        qos = RECORD_RELIABLE if role == "torque_command" else RECORD
        tap = Tap(node, message_type(TYPES[role]), role, qos, lambda *heard: self._keep(role, *heard))
        self._names[role] = tap.topic
        return tap

    def _keep(self, role: str, received: int, raw: bytes) -> None:
        if role != "torque_command":
            self.last = time.monotonic()
        sink = self._contents.sink(self._names[role], TYPES[role])
        assert sink is not None
        sink.log_times.append(received)
        sink.raw.append(raw)

    def _on_health(self, message: DiagnosticArray) -> None:
        """Raise the alarm for failures after the beginning of the run only."""
        for status in message.status:
            if status.level != ERROR:
                self._failed.discard(status.name)
            elif status.name not in self._failed:
                self._failed.add(status.name)
                self._alarm(f"{status.name}: {status.message}")


class LiveRun:
    """Plays a proposal while its bench is recorded; a run that broke off is discarded."""

    def __init__(self, ears: Ears, player: Player) -> None:
        self._ears, self._player = ears, player
        self._over_at, self._why = 0.0, ""
        self._rest = max(_TAIL, SHORTEST + _TAIL - len(player.command) / player.rate)
        ears.begin(self._fail)

    def stop(self, why: str) -> None:
        """Go softly to zero; the run counts for nothing. why: the first reason stays."""
        self._why = self._why or why
        self._player.stop()

    def over(self) -> bool:
        """Return whether the run and its recording are over; stops it where the bench falls silent."""
        silent = time.monotonic() - self._ears.last
        if self._player.started and silent > SILENT:
            self.stop(f"no measurement for {silent:.2f} s")
        if not self._player.over():
            return False
        self._over_at = self._over_at or time.monotonic()
        return bool(self._why) or time.monotonic() - self._over_at > self._rest

    def close(self) -> None:
        """Command zero torque."""
        self._player.close()

    def record(self) -> Record:
        """Return the record. Raises DeviceError for a run that broke off."""
        if self._why:
            raise DeviceError(self._why)
        try:
            record = self._ears.record()
        except RseaError as error:
            raise DeviceError(f"the run left no record: {error}") from None
        if self._player.left_out:
            raise DeviceError(f"{self._player.left_out} commands came too late on this machine")
        for fault in record.faults:
            if fault.kind in BROKEN:
                raise DeviceError(f"{fault.kind} {fault.detail}".strip())
        check_followed(record)
        return record

    def _fail(self, why: str) -> None:
        """Stop when a node of the bench reports a failure."""
        if self._player.started:
            self.stop(why)


def check_followed(record: Record) -> None:
    """Raise DeviceError where the measured motor torque is not the commanded one, as after a trip."""
    if "motor_torque" not in record:
        return
    command, measured = record["command"], record["motor_torque"]
    asked = np.interp(measured.t - 0.5 / command.rate, command.t, command.y, left=0.0, right=0.0)
    size = float(np.sqrt(np.mean(asked**2)))
    away = float(np.sqrt(np.mean((measured.y - asked) ** 2)))
    if away > FOLLOWED * size + 0.2:
        raise DeviceError(
            f"the motor torque was {away:.3g} N·m RMS off the command of {size:.3g} N·m"
        )
