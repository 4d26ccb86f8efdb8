"""Topics of a bench: what it publishes, what it hears, and the states of several joints in one message."""

import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.node import Node

from msg_adapters import ros
from msg_adapters.cdr import VALUES
from msg_adapters.topic_map import FLOATS, JOINT_STATE
from rsea_ros.hardware.device import State
from rsea_ros.nodes._commands import HORIZON, WATCHDOG, CommandQueue, Obeyed
from rsea_ros.nodes._cycle import Anchor, Cycle
from rsea_ros.nodes._health import OK, WARN, NodeHealth
from rsea_ros.nodes._parameters import JOINT, NodeParameter
from rsea_ros.nodes._qos import COMMAND, MEASURED, MEASUREMENT, OVERRIDES
from rsea_ros.nodes._tap import Mailbox, MessageFields, raw_writer

_AHEAD = "commands ahead"
"""Of who stamps ahead: then late ones are. Who stamps when sending is always late, and means on arrival."""


class Namesakes:
    """Other nodes of this one's name that publish its joint states (topic).

    The graph knows a node that was killed for seconds more; it is silent, and its successor is alone.
    """

    def __init__(self, node: Node, topic: str) -> None:
        self._node, self._topic, self._who = node, topic, set[bytes]()
        self._box: Mailbox | None = None

    def look(self) -> str:
        """Return what was heard of them since the last call, in words; empty for nothing."""
        own = self._node.get_name(), self._node.get_namespace()
        self._who.clear()
        if self._node.get_node_names_and_namespaces().count(own) < 2:
            self.close()
        elif self._box is None:
            read = MessageFields(JOINT_STATE, (("position", 0),), most=sys.maxsize)
            self._box = Mailbox(self._node, self._topic, read, MEASUREMENT, lambda: None, admit=self._meet)
        else:
            list(self._box.take())
        if len(self._who) < 2:
            return ""
        name = self._node.get_fully_qualified_name()
        return f"{len(self._who)} nodes are called {name} and publish {self._topic}, expected one"

    def close(self) -> None:
        """Listen no more."""
        if self._box is not None:
            self._node.destroy_subscription(self._box.subscription)
        self._box = None

    def _meet(self, who: Any) -> bool:
        self._who.add(bytes(who))
        return False


NAMES = (
    JOINT,
    NodeParameter("frame", "", "frame_id of joint_states"),
    NodeParameter("ft_frame", "ft_sensor", "frame_id of ft"),
)
"""Parameters of every bench."""
SPRING_FRAME = NodeParameter(
    "spring_frame", "spring_deflection", "frame_id of deflection, and of ft where it is stiffness times that"
)
"""Of a bench whose device may measure the spring by a second encoder."""
COMMANDS = {JOINT_STATE: "effort", FLOATS: VALUES}
"""By type of `torque_command`: the field whose one number is the torque, N m."""
COMMAND_TYPE = NodeParameter("command_type", JOINT_STATE, "type of torque_command", choices=tuple(COMMANDS))
"""Of a driver; numbers without a stamp take effect on arrival."""
MOST = 100
"""Commands taken in a cycle: 28 kHz of them at 280 Hz; each costs 10 us."""


class BenchTopics:
    """Publishes readings, and queues messages on `torque_command`.

    Messages are serialised templates with the numbers filled in (raw_writer).
    """

    def __init__(
        self, node: Node, names: Mapping[str, Any], *, strict: bool = False, every_record: bool = False,
        part: str = "", deflects: bool = False,
    ) -> None:  # fmt: skip
        """names: values of NAMES, and of SPRING_FRAME, COMMAND_TYPE and torque_limit where they may be.
        strict: see CommandQueue; then one publisher is obeyed at a time.
        every_record: ft gets all records since the last reading, not one.
        part: name of a bench among others of the same node; its topics are under it.
        deflects: whether readings have the spring's deflection, which then has a topic.
        """
        within = f"{part}/" if part else ""
        self._node, self._every_record, self._strict = node, every_record, strict
        limit = names.get("torque_limit", math.inf)
        self.commands, self._obeyed = CommandQueue(strict=strict, limit=limit), Obeyed()
        self._reported: Mapping[str, int] = {}
        self._polled = 0
        self._states = _publisher(node, ros.JointState, f"{within}joint_states")
        self.namesakes = Namesakes(node, f"{within}joint_states")
        self._ft = _publisher(node, ros.WrenchStamped, f"{within}ft")
        joint, frame, ft_frame = (names[p.name] for p in NAMES)
        state = ros.joint_state_message(0, 0.0, 0.0, 0.0, joint, frame)
        self._state_writer = raw_writer(state, "position", "velocity", "effort")
        frames = {False: ft_frame, True: names.get(SPRING_FRAME.name, ft_frame)}
        self._ft_writers = {
            inferred: raw_writer(ros.wrench_message(0, (0.0,) * 6, frame=at), "wrench")
            for inferred, at in frames.items()
        }
        angle = ros.state_message(0, [joint], frames[True], position=[0.0])
        self._deflection_writer = raw_writer(angle, "position")
        self._deflections = _publisher(node, ros.JointState, f"{within}deflection") if deflects else None
        kind = names.get(COMMAND_TYPE.name, JOINT_STATE)
        self._wanted = Mailbox(
            node, f"{within}torque_command", MessageFields(kind, ((COMMANDS[kind], 0),), joint),
            COMMAND, self.commands.refuse, admit=self._obeyed.admit if strict else None,
        )  # fmt: skip

    def poll(self, anchor: Anchor) -> None:
        """Put all commands that have arrived into the queue; of a flood no more than a cycle has time for."""
        now = anchor.now()
        for stamp, (torque,), received in self._wanted.take(*((MOST,) if self._strict else ())):
            arrival = anchor.arrival(received, self._polled)
            if self._strict and now - arrival > HORIZON:
                self.commands.refuse()
            else:
                self.commands.add(stamp, torque, arrival)
        self._polled = now

    def publish(self, state: State, shift: int = 0) -> None:
        """Publish one reading under its stamps, shifted by a number of ns."""
        numbers = (state.position, state.velocity, state.motor_torque)
        self._states.publish(self._state_writer.write(state.stamp + shift, numbers))
        if self._deflections is not None and math.isfinite(state.deflection):
            raw = self._deflection_writer.write(state.stamp + shift, (state.deflection,))
            self._deflections.publish(raw)  # before ft: with that a listener's reading is complete
        writer = self._ft_writers[state.inferred]
        if self._every_record:
            for stamp, wrench in state.wrenches:
                self._ft.publish(writer.write(stamp + shift, wrench))
        elif state.wrench is not None:
            self._ft.publish(writer.write(state.ft_stamp + shift, state.wrench))

    def report(self, cycle: Cycle, more: Mapping[str, int] | None = None) -> NodeHealth:
        """Return the health of a bench that runs in a cycle; warnings are of events since the last report.

        more: further counts by their name in words.
        """
        timing, commands = cycle.timing(), self.commands
        counts = {
            "cycles missed": timing.missed,
            "commands late": commands.late,
            _AHEAD: commands.ahead,
            "commands with a stamp that is off": commands.off,
            "commands refused": commands.refused - (commands.off if self._strict else 0),
            "commands of a second publisher ignored": self._obeyed.ignored,
            "steps of the system clock": cycle.anchor.steps,
            **(more or {}),
        }
        new = {kind: count - self._reported.get(kind, 0) for kind, count in counts.items()}
        self._reported = {**self._reported, **counts}
        now_stamped = not new.pop(_AHEAD) and commands.lateness <= WATCHDOG and new.pop("commands late")
        commands.lateness = 0
        troubles = [f"{count} {kind}" for kind, count in new.items() if count > 0]
        note = f"; {now_stamped} commands stamped when sent act on arrival" if now_stamped else ""
        values = {
            **timing.values(),
            "lost_cycles": cycle.left_out,
            **commands.values(cycle.anchor.now()),
            "ignored_commands": self._obeyed.ignored,
            "furthest_stamp_s": f"{commands.furthest:+.3f}",
            **cycle.anchor.values(),
        }
        return NodeHealth(WARN if troubles else OK, (", ".join(troubles) or "running") + note, values)

    def close(self) -> None:
        """Take the topics away."""
        for publisher in filter(None, (self._states, self._ft, self._deflections)):
            self._node.destroy_publisher(publisher)
        self._node.destroy_subscription(self._wanted.subscription)
        self.namesakes.close()


def _publisher(node: Node, kind: Any, topic: str) -> Any:
    return node.create_publisher(kind, topic, MEASURED, qos_overriding_options=OVERRIDES)


class Combined:
    """The topic `joint_states` of the node beside those of its joints. names: of all joints, in order."""

    def __init__(self, node: Node, names: Sequence[str]) -> None:
        self._node = node
        self._publisher = _publisher(node, ros.JointState, "joint_states")
        zeros = [0.0] * len(names)
        states = ros.state_message(0, names, position=zeros, velocity=zeros, effort=zeros)
        self._writer = raw_writer(states, "position", "velocity", "effort")

    def publish(self, states: Sequence[State | None], shift: int) -> None:
        """Publish the readings of a cycle under the first one's stamp; nothing where one is lost.

        shift: ns, of the stamps.
        """
        read = [state for state in states if state is not None]
        if len(read) < len(states):
            return
        numbers = [state.position for state in read] + [state.velocity for state in read]
        numbers += [state.motor_torque for state in read]
        self._publisher.publish(self._writer.write(read[0].stamp + shift, numbers))

    def close(self) -> None:
        """Take the topic away."""
        self._node.destroy_publisher(self._publisher)
