"""Which of the model node's sensors have stopped: each is compared with the motion of the others."""

from __future__ import annotations

from rsea_ros.model.rig import Rig
from rsea_ros.nodes._frozen import Frozen

MOVED, LEAST = 12.0, 0.1
"""Standard deviations of ft, and N m, by which it must move while joint_states stand still, to tell that they
have stopped: more than noise does in a second, less than what matters."""


class StoppedSensors:
    """Watches joint_states and ft beside the commands."""

    def __init__(self, ft_noise: float, stiffness: float = 0.0, *, ft_repeats: bool = False) -> None:
        """ft_noise: standard deviation, N m. stiffness: of the spring, N m/rad.

        ft_repeats: whether ft may repeat a value at rest because its quantum exceeds its noise, as that of an
        encoder does.
        """
        least = max(MOVED * ft_noise, LEAST)
        self._states_by_ft, self._states_by_command = Frozen(least), Frozen(least)
        self._ft, self._stiffness = Frozen(least if ft_repeats else 0.0), stiffness

    def take_state(self, stamp: int, position: float, effort: float) -> bool:
        """Process a state (ns, rad, N m); return whether joint_states have stopped."""
        self._states_by_command.take(stamp, (position, effort))
        self._ft.beside(self._stiffness * position)
        return self._states_by_ft.take(stamp, (position, effort))

    def take_ft(self, stamp: int, torque: float) -> bool:
        """Process a torque of the sensor (ns, N m); return whether ft has stopped."""
        self._states_by_ft.beside(torque)
        return self._ft.take(stamp, (torque,))

    def take_command(self, torque: float) -> None:
        """Process a commanded torque, N m."""
        self._states_by_command.beside(torque)

    @property
    def ft_frozen(self) -> bool:
        """Whether ft repeats a value where it should change."""
        return self._ft.frozen

    @property
    def frozen(self) -> list[str]:
        """Topics that repeat a value where it should change."""
        topics = (("joint_states", self._states_by_ft), ("ft", self._ft))
        return [topic for topic, sensor in topics if sensor.frozen]

    @property
    def unmoved(self) -> bool:
        """Whether joint_states repeat a value while commands move: they have stopped, or the drive is off."""
        return self._states_by_command.frozen


def stopped_sensors(rig: Rig, ft_noise: float) -> StoppedSensors:
    """Return the watch of a rig's sensors. ft_noise: standard deviation, N m."""
    ft = rig.sensors.get("ft")
    ft_repeats = ft is not None and ft.quantum > 2.0 * ft.noise
    return StoppedSensors(ft_noise, rig["spring.stiffness"], ft_repeats=ft_repeats)
