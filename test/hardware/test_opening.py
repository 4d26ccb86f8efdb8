"""Settings that do not fit the machine are refused at opening, by name and number."""

import pytest

from rsea_ros.errors import RseaError
from rsea_ros.hardware.device import PortLost
from rsea_ros.hardware.dynamixel.port import SerialPort
from rsea_ros.hardware.limits import Limits

WRONG = {
    "another model": ({"model": 54025}, Limits(68.0), "model 54024, expected 54025"),
    "another ID": ({"identity": 7}, Limits(68.0), "motor ID 7 on .*: no reply to ping"),
    "more than the motor's limit": ({}, Limits(100.0), "100 N·m, expected at most 68.19 N·m"),
    "more than the spring bears": ({}, Limits(68.0, deflection=0.02), "the rig's spring of 1530 N·m/rad"),
}


@pytest.mark.parametrize("name", WRONG)
def test_settings_that_do_not_fit_the_machine_are_refused(benches, device, name):
    motor, limits, message = WRONG[name]
    with pytest.raises(RseaError, match=message):
        device(limits, **motor).open()
    assert benches().torque() == (0, False)


def test_a_port_that_does_not_exist_is_named(tmp_path):
    port = SerialPort(str(tmp_path / "nothing"), 4_000_000, 1e-3)
    with pytest.raises(PortLost, match=r"port .*nothing: .*expected a serial port that is free"):
        port.open()


def test_an_unknown_model_is_refused_by_its_number(benches, device):
    bench = benches()
    bench.ask("model", number=1060)
    try:
        with pytest.raises(RseaError, match=r"model 1060, expected one of .*1020.*54024"):
            device().open()
    finally:
        bench.ask("model", number=54024)


def test_a_sensor_without_a_stream_is_refused_and_the_motor_left_off(benches, device, monkeypatch):
    monkeypatch.setattr("rsea_ros.hardware.netft.sensor.FIRST", 0.3)
    bench = benches()
    bench.ask("misbehave", ft_silent=True)
    with pytest.raises(RseaError, match=r"no record within 0\.3 s, expected a stream"):
        device().open()
    bench.ask("misbehave", ft_silent=False)
    assert bench.torque() == (0, False)
