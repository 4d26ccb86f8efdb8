"""plant: a simulated bench in real time, for any rig."""

import time
from typing import Any

from rclpy.node import Node

from rsea_ros.hardware.simulated import SimulatedDevice
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._bench_topics import NAMES, SPRING_FRAME, BenchTopics
from rsea_ros.nodes._cycle import SECOND, Cycle
from rsea_ros.nodes._health import Health
from rsea_ros.nodes._parameters import NodeParameter
from rsea_ros.nodes._run import Component, Program

TABLE = (
    NodeParameter("rig", "paper_high_impedance", "rig to simulate: a name of config/rigs, or a file"),
    NodeParameter("rate", 280.0, "samples a second", "Hz", 10.0, 1000.0),
    NodeParameter("seed", 0, "seed of the sensors' noise", "", 0, 1_000_000_000),
    NodeParameter("noise", True, "whether the sensors have their noise and quantum"),
    NodeParameter("duration", 60.0, "time over which drifts come to their full size", "s", 1.0, 1e6),
    *NAMES,
    SPRING_FRAME,
)
STALL, PAUSE = SECOND // 50, 0.005
"""After a stall of so many ns, the pause (s) in which commands arrive that were held up with this process."""


class PlantNode(Program):
    """Simulates up to each deadline with the commands that took effect until then, and publishes.

    The simulation ends at the instant of the stamp; a command with a stamp in between acts from that
    stamp on, so a bag of these topics shows what happened, without an added delay.
    """

    def __init__(self, node: Node, values: dict[str, Any]) -> None:
        rig = load_rig(values["rig"])
        self._log = node.get_logger()
        self._now = self._behind = 0
        self._device = SimulatedDevice(
            rig,
            values["rate"],
            seed=values["seed"],
            noise=values["noise"],
            duration=values["duration"],
            clock=lambda: self._now,
        )
        self._topics = BenchTopics(node, values, deflects="deflection" in rig.sensors)
        self._cycle = Cycle(values["rate"], self._step, catch_up=True)
        self._health = Health(node, lambda: self._topics.report(self._cycle), f"simulated {values['rig']}")
        self._log.info(f"rig {rig.name} at {values['rate']:g} Hz")
        self._cycle.start()

    def _step(self, stamp: int) -> None:
        if not self._now:
            self._now = stamp
            self._device.open()
        behind = self._cycle.anchor.now() - stamp
        if behind > STALL >= self._behind:  # once after a stall: commands sent meanwhile are on their way
            time.sleep(PAUSE)
        self._behind = behind
        self._topics.poll(self._cycle.anchor)
        for instant, torque in self._topics.commands.take(stamp):
            self._now = instant
            self._device.write(torque)
        self._now = stamp
        self._topics.publish(self._device.read())

    def is_finished(self) -> bool:
        return not self._cycle.is_running()

    def close(self) -> None:
        """Stop the simulation, at zero torque; warn if a bag of it would have wrong stamps."""
        self._cycle.stop()
        self._device.close()
        if mistimed := self._topics.commands.late + self._topics.commands.unstamped:
            self._log.warning(f"{mistimed} commands did not act at their stamps, as a bag says they did")
        if gaps := self._cycle.left_out:
            self._log.warning(f"{gaps} samples were left out while this machine stood still")


NODE = Component("plant", TABLE, PlantNode)
main = NODE.run

if __name__ == "__main__":
    raise SystemExit(main())
