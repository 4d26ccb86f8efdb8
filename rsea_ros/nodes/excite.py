"""excite: plays an excitation as torque commands, and always ends with zeros.

It waits for a driver that is not active, and ends with one line where it has latched a fault.
"""

from typing import Any

from rclpy.node import Node

from rsea_ros.experiment.run_shape import read_run
from rsea_ros.identification.excitation import KINDS, ExcitationSettings, check_limits, excitation
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.rig_limits import derive
from rsea_ros.nodes._health import OK, STEADY, WARN, Health, NodeHealth
from rsea_ros.nodes._parameters import DERIVED, JOINT, NodeParameter, stated_limits
from rsea_ros.nodes._player import BenchStatus, Player
from rsea_ros.nodes._run import Component, Program
from rsea_ros.records.record import FloatArray

TABLE = (
    NodeParameter("file", "", "run.csv of rsea experiment to play instead; empty: what follows"),
    NodeParameter("kind", "chirp", "excitation", choices=tuple(KINDS)),
    NodeParameter(
        "amplitude", 20.0, "peak of chirp and steps, rms of multisine and white noise", "N m", 0.0, 1e4
    ),
    NodeParameter("noise", 10.0, "standard deviation of the noise on top of the chirp", "N m", 0.0, 1e4),
    NodeParameter("duration", 160.0, "length without the ramps of a multisine", "s", 0.1, 1e5),
    NodeParameter("rate", 280.0, "commands a second", "Hz", 50.0, 1000.0),
    NodeParameter("low", 0.01, "lowest frequency", "Hz", 1e-4, 500.0),
    NodeParameter("high", 140.0, "highest frequency, kept below 0.475 of the rate", "Hz", 1e-3, 500.0),
    NodeParameter("period", 10.0, "period of multisine and steps", "s", 0.01, 1e4),
    NodeParameter("seed", 0, "seed of noise and phases", "", 0, 1_000_000_000),
    NodeParameter("rig", "paper_high_impedance", "the bench: a name of config/rigs, or a model.yaml"),
    NodeParameter(
        "limit", DERIVED, "largest torque, of the whole excitation; -1: as the driver derives it", "N m",
        DERIVED, 1e4,
    ),
    NodeParameter("ramp", 0.5, "raised cosine at either end", "s", 0.0, 100.0),
    NodeParameter("lead", 0.1, "how long before it takes effect a command is published", "s", 0.0, 0.2),
    NodeParameter("subscribers", 1, "subscriptions of torque_command to wait for", "", 1, 100),
    JOINT,
)


class ExciteNode(Program):
    """Plays one excitation, or the file of one, and ends."""

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        command, rate = plan(values)
        stated = stated_limits({"torque_limit": values["limit"]}, ("torque",))
        check_limits(command, derive(stated, load_rig(values["rig"]))[0]["torque"], rate)
        self._node, self._wanted = node, values["subscribers"]
        self._bench = BenchStatus(node, values["joint"], float(abs(command).max(initial=0.0)))
        self._player = Player(
            node, command, rate, self._bench, lead=values["lead"], wanted=self._wanted, joint=values["joint"]
        )
        self._health = Health(node, self._report)
        node.create_timer(1.0, self._tell, clock=STEADY)

    def is_finished(self) -> bool:
        """Return whether the whole excitation is out. Raises DeviceError where the bench makes no torque."""
        self._bench.check(playing=self._player.started)
        return self._player.over()

    def close(self) -> None:
        """Command zero torque after the last command, and wait until that has arrived."""
        self._player.close()
        p = self._player
        self._node.get_logger().info(f"torque zero after {p.next} commands, {p.left_out} left out")

    def _tell(self) -> None:
        p = self._player
        if p.started:
            share = min(1.0, p.next / len(p.command))
            self._node.get_logger().info(f"{share:.0%} of {len(p.command) / p.rate:.1f} s")
        else:
            wanted = self._bench.idle or (
                f"{p.subscriptions} of {self._wanted} subscriptions of torque_command and a message on "
                "joint_states"
            )
            self._node.get_logger().info(f"waiting: {wanted}", throttle_duration_sec=5.0)

    def _report(self) -> NodeHealth:
        p = self._player
        values = {"commands": p.next, "left_out": p.left_out}
        if p.started:
            values |= p.cycle.timing().values()  # type: ignore[arg-type]
        level = WARN if p.left_out else OK
        return NodeHealth(level, "running" if p.started else "waiting for a measurement", values)


def plan(values: dict[str, Any]) -> tuple[FloatArray, float]:
    """Return the command, N m, and its rate, Hz: of `file` where one is given, else of the parameters."""
    if values["file"]:
        return read_run(values["file"])
    names = ("rate", "duration", "amplitude", "noise", "low", "high", "period", "seed")
    command = excitation(values["kind"], ExcitationSettings(**{n: values[n] for n in names}), values["ramp"])
    return command, values["rate"]


NODE = Component("excite", TABLE, ExciteNode, endless=False)
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
