"""Dynamixel X, MX, P and Pro: tables against the maker's numbers, all on the wire, and wrong settings."""

import math
from contextlib import closing, suppress
from pathlib import Path
from statistics import fmean

import pytest

from rsea_ros.errors import RseaError
from rsea_ros.hardware.device import PortLost, State
from rsea_ros.hardware.dynamixel.bus import SerialPort
from rsea_ros.hardware.dynamixel.control_tables import TABLES
from rsea_ros.hardware.limits import Limits
from rsea_ros.hardware.motor_netft import CONFIGURE, MOTOR, ROBOTIS
from rsea_ros.hardware.peer.peer_motor import ACCESS, LIMIT, RANGE, EmulatedMotor
from rsea_ros.hardware.peer.registers import MODELS
from test.hardware.conftest import Loop, device_on, well_behaved

STALL = {
    "XM430-W350": ((3.8, 2.1), (4.1, 2.3), (4.8, 2.7)), "XM430-W210": ((2.7, 2.1), (3.0, 2.3), (3.7, 2.7)),
    "XM540-W150": ((6.9, 4.2), (7.3, 4.4), (8.9, 5.5)), "XM540-W270": ((10.0, 4.2), (10.6, 4.4), (12.9, 5.5)),
    "XH430-W210": ((2.2, 1.2), (2.5, 1.3), (3.1, 1.5)), "XH430-W350": ((3.1, 1.2), (3.4, 1.3), (4.2, 1.5)),
    "XH540-W150": ((6.6, 4.5), (7.1, 4.9), (8.5, 5.9)), "XH540-W270": ((9.2, 4.5), (9.9, 4.9), (11.7, 5.9)),
    "XW540-T140": ((6.4, 4.5), (6.9, 4.9), (8.3, 5.9)), "XW540-T260": ((8.8, 4.5), (9.5, 4.9), (11.2, 5.9)),
    "XH430-V210": ((2.6, 0.7),) * 2, "XH430-V350": ((3.3, 0.7),) * 2,
    "XH540-V150": ((6.4, 2.4),) * 2, "XH540-V270": ((9.2, 2.4),) * 2,
    "XL330-M077": ((0.18, 1.11), (0.215, 1.47), (0.228, 1.74)),
    "XL330-M288": ((0.42, 1.11), (0.52, 1.47), (0.6, 1.74)),
    "XC330-M181": ((0.52, 1.34), (0.6, 1.8), (0.66, 2.15)),
    "XC330-M288": ((0.69, 1.34), (0.93, 1.8), (1.1, 2.15)),
    "XC330-T181": ((0.65, 0.61), (0.76, 0.8), (0.8, 0.88)),
    "XC330-T288": ((0.76, 0.61), (0.92, 0.8), (1.0, 0.88)),
    "MX-64(2.0)": ((5.5, 3.9), (6.0, 4.1), (7.3, 5.2)), "MX-106(2.0)": ((8.0, 4.8), (8.4, 5.2), (10.0, 6.3)),
}  # fmt: skip
"""N m, A at stall, by voltage, as the e-manual prints them; the second is at the recommended voltage."""
RATIO = {"XM430-W350": 149.795386991, "XM430-W210": 235.53647082, "XM540-W150": 289.13672036,
         "XM540-W270": 156.133829, "H54-200-S500-R": 9.09201, "PH54-200-S500-R": 146.502114,
         "PH54-100-S500-R": 155.658486, "PH42-020-S300-R": 109.3747778}  # fmt: skip
"""Counts of the current for a N m, of ROBOTIS-Framework."""
TORQUE_OF_A_COUNT = {"XH540-W150": 0.0045, "XC330-T181": 0.0006709470296, "XC330-T288": 0.000967479674}
"""N m, of the maker's dxl_model, where that has a unit for the current."""
CONTINUOUS = {"H54-200-S500-R": (44.7, 9.3), "PH54-200-S500-R": (44.7, 9.3), "PH54-100-S500-R": (25.3, 5.5),
              "PH42-020-S300-R": (5.1, 1.5), "PM54-040-S250-R": (3.9, 1.9),
              "PM54-060-S250-R": (10.1, 3.0)}  # fmt: skip
BY_NAME = {table.name: table for table in TABLES.values()}


@pytest.mark.parametrize("name", STALL)
def test_constants_of_x_and_mx_are_the_stall_ratios_of_the_manual(name):
    constant, ratios = BY_NAME[name].torque_constant, [torque / current for torque, current in STALL[name]]
    assert constant.value == pytest.approx(ratios[1], rel=1e-3)
    assert constant.low <= min(ratios) * 1.001 and max(ratios) * 0.999 <= constant.high


@pytest.mark.parametrize("name", sorted({*RATIO, *CONTINUOUS, *TORQUE_OF_A_COUNT}))
def test_the_spread_of_a_constant_holds_the_makers_ratio_and_the_continuous_point(name):
    table, inside = BY_NAME[name], []
    if name in RATIO:
        inside.append(1.0 / (RATIO[name] * table.ampere))
    if name in TORQUE_OF_A_COUNT:
        inside.append(TORQUE_OF_A_COUNT[name] / table.ampere)
    if name in CONTINUOUS:
        torque, current = CONTINUOUS[name]
        inside.append(torque / current)
    for each in inside:
        assert table.torque_constant.low * 0.999 <= each <= table.torque_constant.high * 1.001


OF_MX = {
    "firmware": (6, 1), "return_delay": (9, 1), "drive_mode": (10, 1), "operating_mode": (11, 1),
    "homing_offset": (20, 4), "temperature_limit": (31, 1), "max_voltage": (32, 2), "min_voltage": (34, 2),
    "torque_limit": (38, 2), "torque_enable": (64, 1), "status_level": (68, 1), "hardware_error": (70, 1),
    "bus_watchdog": (98, 1), "goal_torque": (102, 2), "current": (126, 2), "velocity": (128, 4),
    "position": (132, 4), "voltage": (144, 2), "temperature": (146, 1),
}  # fmt: skip
"""All that is used, as mx_64, mx_106, xl330_*, xc330_*, xw540_h260 of the maker's dxl_model have it."""
OF_X = {**OF_MX, "startup": (60, 1)}
PRINTED = {
    **dict.fromkeys((311, 321), OF_MX),
    **dict.fromkeys((1190, 1200, 1210, 1220, 1230, 1240, 1310, 1710), OF_X),
    1020: {"torque_limit": (38, 2), "torque_enable": (64, 1), "bus_watchdog": (98, 1),
           "goal_torque": (102, 2), "current": (126, 2), "velocity": (128, 4), "position": (132, 4),
           "voltage": (144, 2), "temperature": (146, 1), "hardware_error": (70, 1),
           "homing_offset": (20, 4), "startup": (60, 1)},
    2020: {"torque_limit": (38, 2), "torque_enable": (512, 1), "bus_watchdog": (546, 1),
           "goal_torque": (550, 2), "current": (574, 2), "velocity": (576, 4), "position": (580, 4),
           "voltage": (592, 2), "temperature": (594, 1), "hardware_error": (518, 1),
           "homing_offset": (20, 4), "startup": (60, 1)},
    54024: {"torque_limit": (30, 2), "torque_enable": (562, 1), "goal_torque": (604, 2), "current": (621, 2),
            "velocity": (615, 4), "position": (611, 4), "voltage": (623, 2), "temperature": (625, 1),
            "hardware_error": (892, 1), "homing_offset": (13, 4)},
}  # fmt: skip
"""Address and size as the e-manual prints them, of one model of each series."""


@pytest.mark.parametrize("model", PRINTED)
def test_addresses_are_those_of_the_manual(model):
    items = TABLES[model].items
    assert {name: (items[name].address, items[name].size) for name in PRINTED[model]} == PRINTED[model]
    assert PRINTED[model] not in (OF_X, OF_MX) or items.keys() == PRINTED[model].keys()


UNITS = {311: 0.00336, 321: 0.00336, 1310: 0.00269}
UNITS |= dict.fromkeys((1190, 1200, 1210, 1220, 1230, 1240, 1710), 0.001)
"""A of a count of the current, as the e-manual prints them."""


@pytest.mark.parametrize("model", UNITS)
def test_counts_of_x330_x335_and_mx_are_worth_what_the_maker_says(model):
    table = TABLES[model]
    assert table.ampere == UNITS[model]
    assert table.radian_per_second == pytest.approx(0.0239691227, rel=1e-3)  # 0.229 rpm
    assert math.tau / table.pulses == pytest.approx(0.0015339807878856412)


def test_the_zero_of_the_makers_urdfs_is_the_offset_of_its_ros_packages():
    offset = {"x": -3.14159265359, "mx": -3.14159265359, "p": 0.0, "pro": 0.0}
    for table in TABLES.values():
        assert -table.zero * math.tau / table.pulses == pytest.approx(offset[table.series], abs=1e-9)


def test_the_page_of_devices_has_every_model_with_its_numbers():
    page = (Path(__file__).resolve().parents[2] / "docs" / "devices.md").read_text(encoding="utf-8")
    for number, table in TABLES.items():
        known = table.torque_constant
        torque = f"{known.value:g} | {known.low:g} to {known.high:g} |" if known else "not known, set it | |"
        assert f"| {table.name} | {number} | {1e3 * table.ampere:.4g} | {table.pulses} | {torque}\n" in page


def test_the_bench_has_every_model_with_the_same_units():
    """The bench has independent tables: a typing error in either of them fails here."""
    assert set(MODELS) == set(TABLES)
    names = {"goal": "goal_torque", "mode": "operating_mode", "watchdog": "bus_watchdog"}
    for number, model in MODELS.items():
        table = TABLES[number]
        assert table.ampere == pytest.approx(model.ampere) and table.pulses == model.counts_per_turn
        assert table.radian_per_second == pytest.approx(model.radian_per_second)
        if known := table.torque_constant:
            assert model.constant == pytest.approx(known.value, rel=1e-3), number
        for name, register in model.registers.items():
            item = table.optional(names.get(name, name))
            if item is not None:
                address = (register.address, register.size, register.signed)
                assert (item.address, item.size, item.signed) == address, f"{number} {name}"


X = {
    "id": (0, 252, 1), "baud": (0, 7, 1), "return_delay": (0, 254, 250), "drive_mode": (0, 13, 0),
    "mode": (0, 16, 3), "homing_offset": (-1044479, 1044479, 0), "temperature_limit": (0, 100, 80),
    "startup": (0, 3, 0), "shutdown": (0, 63, 52), "torque_enable": (0, 1, 0), "status_level": (0, 2, 2),
    "watchdog": (0, 127, 0), "goal_pwm": (-885, 885, 0),
}  # fmt: skip
PERMITTED = {
    1020: X | {"max_voltage": (95, 160, 160), "min_voltage": (95, 160, 95), "torque_limit": (0, 1193, 1193)},
    1040: X | {"max_voltage": (110, 300, 300), "min_voltage": (110, 300, 110), "torque_limit": (0, 689, 689)},
    1200: X | {"baud": (0, 6, 1), "drive_mode": (0, 5, 0), "temperature_limit": (0, 100, 70),
               "shutdown": (0, 63, 53), "max_voltage": (31, 70, 70), "min_voltage": (31, 70, 35),
               "torque_limit": (0, 1750, 1750)},
    1220: X | {"baud": (0, 6, 1), "temperature_limit": (0, 100, 70), "max_voltage": (55, 140, 140),
               "min_voltage": (55, 140, 55), "torque_limit": (0, 910, 910)},
    1310: X | {"max_voltage": (110, 300, 300), "min_voltage": (110, 300, 110),
               "torque_limit": (0, 1188, 1188)},
    311: {name: row for name, row in X.items() if name != "startup"}
    | {"max_voltage": (95, 160, 160), "min_voltage": (95, 160, 95), "torque_limit": (0, 1941, 1941)},
    2020: X | {"baud": (0, 9, 3), "homing_offset": (-(2**31), 2**31 - 1, 0), "shutdown": (0, 63, 58),
               "max_voltage": (150, 350, 350), "min_voltage": (150, 350, 150), "goal_pwm": (-2009, 2009, 0),
               "torque_limit": (0, 22740, 22740)},
    54024: {"id": (0, 252, 1), "baud": (0, 8, 3), "return_delay": (0, 254, 250), "mode": (0, 4, 3),
            "homing_offset": (-(2**31), 2**31 - 1, 0), "temperature_limit": (0, 100, 80),
            "max_voltage": (0, 400, 400), "min_voltage": (0, 400, 150), "torque_limit": (0, 1860, 620),
            "shutdown": (0, 63, 58), "torque_enable": (0, 1, 0), "status_level": (0, 2, 2)},
}  # fmt: skip
"""Least, largest and first value of the items that may be written, as the e-manual prints them."""
IN_RAM = {"torque_enable", "status_level", "watchdog", "goal", "goal_pwm", "goal_velocity", "goal_position"}
MEASURED = {"position", "velocity", "current", "voltage", "temperature", "hardware_error", "tick"}


class Nothing:
    def read(self):
        return State(0, 0.0, 0.0, 0.0, 0, None)

    def write(self, torque):
        pass


@pytest.mark.parametrize("number", PERMITTED)
def test_the_bench_takes_what_the_manual_permits_and_nothing_beside(number):
    motor, rows = EmulatedMotor(number, Nothing()), PERMITTED[number]

    def write(name, value):
        item = registers[name]
        return motor.write(0, item.address, value.to_bytes(item.size, "little", signed=item.signed))

    registers, most = motor.model.registers, rows["torque_limit"][1]
    assert set(registers) <= {*rows, *MEASURED, *IN_RAM}
    assert motor.get("voltage") in (50, 111, 120, 240) and motor.get("temperature") == 32
    assert [motor.get(name) for name in rows] == [start for *_, start in rows.values()]
    goals = {"goal_velocity": (-(2**31), 2**31 - 1, 0), "goal_position": (-(2**31), 2**31 - 1, 0)}
    motor.put("torque_limit", most)
    for name, (low, high, start) in {**rows, **goals, "goal": (-most, most, 0)}.items():
        for value, told in ((low, 0), (high, 0), (low - 1, RANGE), (high + 1, RANGE)):
            with suppress(OverflowError):  # what its bytes cannot say
                assert write(name, value) == told, (name, value)
        motor.put(name, start if name != "torque_limit" else most)
    motor.put("torque_limit", 600)
    assert [write("goal", value) for value in (600, -600, 601, -601)] == [0, 0, LIMIT, LIMIT]
    motor.put("torque_enable", 1)
    for name in registers:
        assert write(name, motor.get(name)) == (0 if name in IN_RAM else ACCESS), name


SMALL = Limits(2.0, deflection=math.inf, voltage=9.0, current=10.0)


SMALLER = Limits(0.4, deflection=math.inf, voltage=4.0, current=1.5)


@pytest.mark.parametrize(
    ("model", "limits", "given"),
    [(1020, SMALL, 0.0), (2120, SMALL, 0.0), (311, SMALL, 0.0), (1200, SMALLER, 0.0), (1310, SMALL, 3.5)],
)
def test_each_series_makes_the_torque_and_says_what_it_is(benches, model, limits, given):
    bench, half = benches(model), limits.torque / 2.0
    well_behaved(bench)
    loop = Loop(bench, limits, model=model, torque_constant=given)
    loop.guarded.enable()
    loop.cycles(50, half)
    made, table = fmean(state.motor_torque for state in loop.states[10:]), TABLES[model]
    health, constant = loop.device.health(), given or table.torque_constant.value
    goal = bench.torque()
    loop.close()
    assert loop.guarded.fault is None and goal == (round(half / (constant * table.ampere)), True)
    assert made == pytest.approx(half, abs=0.05 + table.ampere * constant)
    assert health["ft_low_pass"] == "0"
    said = given or table.torque_constant.low
    assert health["motor"] == table.name and str(said) in str(health["torque_constant"])
    assert bench.torque() == (0, False)


UNFIT = {
    "drive_mode 8: a goal that is written switches its torque on, expected 0": (1020, {"drive_mode": 8}, 0),
    "startup 1: its torque is on when the power comes, expected 0": (1020, {"startup": 1}, 0),
    "temperature_limit = 70 °C, expected at most 60 °C": (1020, {"temperature_limit": 60}, 80),
    "voltage_limit = 9 V, expected less than 8.5 V": (1020, {"max_voltage": 85}, 160),
    "torque_limit = 2 N·m, expected at most 1.439 N·m, the motor's own": (1020, {"torque_limit": 300}, 1193),
    "torque_constant = 0, expected N·m/A: no source gives": (2120, {"number": 2100}, 2120),
    "model 1060, expected one of .*1020.*54024": (54024, {"number": 1060}, 54024),
}
"""What is said of a motor, its model, one of its values, and what that is otherwise."""


@pytest.mark.parametrize("told", UNFIT)
def test_what_a_motor_is_and_keeps_must_fit_the_drivers_limits(benches, told):
    model, wrong, usual = UNFIT[told]
    bench, what = benches(model), "model" if "number" in wrong else "set"
    bench.ask(what, **wrong)
    try:
        with pytest.raises(RseaError, match=told):
            device_on(bench, SMALL).open()
    finally:
        bench.ask(what, **dict.fromkeys(wrong, usual))
    assert bench.torque() == (0, False)


def test_an_old_firmware_without_the_bus_watchdog_is_supervised(benches):
    bench = benches(1020)
    bench.ask("firmware", number=37)
    try:
        device = device_on(bench, SMALL)
        device.open()
        assert device.protection.kind == "supervisor"
        device.close()
    finally:
        bench.ask("firmware", number=45)


def test_angles_count_from_configure_the_motors_zero_with_its_homing_offset_or_that_of_the_urdfs(benches):
    bench = benches(1020)
    well_behaved(bench)
    bench.ask("set", homing_offset=-1024)
    try:
        angles = []
        for zero in (CONFIGURE, MOTOR, ROBOTIS):
            urdf = zero == ROBOTIS
            with closing(device_on(bench, SMALL, zero=zero, urdf_zero=urdf, latency=1.0)) as device:
                device.open()
                angles.append(device.read().position)
                offset = device.health()["homing_offset_rad"]
    finally:
        bench.ask("set", homing_offset=0)
    assert angles[0] == pytest.approx(0.0, abs=0.01)
    assert angles[1] == pytest.approx((1234 - 1024) * 2.0 * math.pi / 4096, abs=0.01)
    assert angles[2] == pytest.approx((1234 - 1024) * 0.0015339807878856412 - 3.14159265359, abs=0.01)
    assert float(offset) == pytest.approx(-math.pi / 2.0, rel=1e-4)


WRONG = {
    "another model": ({"model": 54025}, Limits(68.0), "model 54024, expected 54025"),
    "another ID": ({"identity": 7}, Limits(68.0), "motor ID 7 on .*: no reply to ping"),
    "more than the motor's limit": ({}, Limits(100.0), "100 N·m, expected at most 68.19 N·m"),
    "more than the spring bears": ({}, Limits(68.0, deflection=0.02), "the rig's spring of 1530 N·m/rad"),
}


@pytest.mark.parametrize("name", WRONG)
def test_settings_that_do_not_fit_the_machine_are_refused(benches, name):
    motor, limits, message = WRONG[name]
    with pytest.raises(RseaError, match=message):
        device_on(benches(), limits, **motor).open()
    assert benches().torque() == (0, False)


def test_a_port_that_does_not_exist_is_named(tmp_path):
    port = SerialPort(str(tmp_path / "nothing"), 4_000_000, 1e-3)
    with pytest.raises(PortLost, match=r"port .*nothing: .*expected a serial port that is free"):
        port.open()


def test_a_sensor_without_a_stream_is_refused_and_the_motor_left_off(benches, monkeypatch):
    monkeypatch.setattr("rsea_ros.hardware.netft.sensor.FIRST", 0.3)
    bench = benches()
    bench.ask("misbehave", ft_silent=True)
    with pytest.raises(RseaError, match=r"no record within 0\.3 s, expected a stream"):
        device_on(bench).open()
    bench.ask("misbehave", ft_silent=False)
    assert bench.torque() == (0, False)
