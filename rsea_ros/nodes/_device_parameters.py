"""Parameters of the driver: motor, F/T sensor, limits."""

from __future__ import annotations

from rsea_ros.nodes._parameters import AXIS, Parameter

MOTOR = (
    Parameter("port", "/dev/ttyUSB0", "serial port of the motor"),
    Parameter("baud", 1_000_000, "of the serial port, as the motor is set", "bit/s", 9600, 10_500_000),
    Parameter("fast_sync", False, "whether several motors on a port answer in one packet"),
    Parameter("id", 1, "of the motor on its bus", "", 0, 252),
    Parameter(
        "model", 0, "number that the motor must have (docs/hardware.md); 0: any that is known", "", 0, 65535
    ),
    Parameter(
        "torque_constant", 0.0, "torque at the gear output for a current; 0: that of the model's table",
        "N m/A", 0.0, 100.0,
    ),
    Parameter(
        "position_zero", "configure",
        "where angles are zero: where configure finds it, or the motor's own zero",
        choices=("configure", "motor"),
    ),
    Parameter(
        "latency", 0.0, "what adapter and host may add to a reply; 0: by the rate, docs/hardware.md", "s",
        0.0, 0.1,
    ),
    Parameter("watchdog", 0.1, "time without the driver after which the motor is stopped", "s", 0.02, 2.5),
    Parameter("supervisor", "", "socket of a supervisor that runs as a service; empty: a child process"),
)
SAFETY = (
    Parameter(
        "allow_no_dead_host_protection", False,
        "whether a device is driven whose torque nothing ends when this process dies",
    ),
    Parameter("device_options", "", "of a device of RSEA_DEVICES: NAME=VALUE,…"),
)  # fmt: skip
"""Of every device."""
SENSOR = (
    Parameter("ft_host", "192.168.1.1", "address of the F/T sensor; empty: there is none"),
    Parameter("ft_port", 49152, "UDP port of its stream", "", 1, 65535),
    Parameter("ft_page_port", 80, "TCP port of its web page", "", 1, 65535),
    Parameter("ft_timeout", 0.01, "time without a record that is a fault", "s", 0.001, 1.0),
    Parameter("ft_all", False, "whether ft has every record, or one a cycle"),
)
LIMITS = (
    Parameter("torque_limit", 68.0, "largest torque that is commanded", "N m", 0.0, 1000.0),
    Parameter("slew_limit", 10_000.0, "largest change of torque in a second", "N m/s", 1.0, 1e6),
    Parameter("soft_start", 500.0, "growth of the limit after activation, fault, pause", "N m/s", 1.0, 1e6),
    Parameter("deflection_limit", 0.0873, "of the spring; 0: none", "rad", 0.0, 100.0),
    Parameter("velocity_limit", 5.0, "of the gear output; 0: none", "rad/s", 0.0, 1000.0),
    Parameter("position_limit", 0.0, "either way from where configure finds it; 0: none", "rad", 0.0, 1e4),
    Parameter("ft_limit", 110.0, "of the torque that ft measures; 0: none", "N m", 0.0, 1000.0),
    Parameter("power_limit", 250.0, "of the motor torque times velocity; 0: none", "W", 0.0, 1e5),
    Parameter("effort_limit", 6.0, "by which measured may miss commanded; 0: none", "N m", 0.0, 1000.0),
    Parameter("effort_time", 0.1, "for which it may", "s", 0.0, 10.0),
    Parameter("temperature_limit", 70.0, "of the motor", "°C", 0.0, 100.0),
    Parameter("current_limit", 12.0, "of the motor, measured", "A", 0.0, 100.0),
    Parameter("voltage_limit", 20.0, "lowest supply voltage", "V", 0.0, 100.0),
    Parameter("command_timeout", 0.05, "time without a command that ends the torque", "s", 0.001, 10.0),
    Parameter("ramp", 0.02, "from there to zero torque", "s", 0.0, 10.0),
    Parameter("lost_cycles", 3, "cycles in a row without an answer that are a fault", "", 1, 100),
    Parameter("lost_time", 0.01, "which they last at least, at any rate", "s", 0.0, 0.1),
    AXIS,
)
