"""An actuator with two encoders and no F/T sensor on the wire: ft is stiffness times deflection."""

import pytest

from msg_adapters.ros import JointState, WrenchStamped, stamp_of
from rsea_ros.hardware.peer.peer_motor import IDENTITY
from rsea_ros.hardware.peer.registers import ENCODER
from rsea_ros.model.rig_file import load_rig
from rsea_ros.nodes._qos import MEASUREMENT
from test.nodes.on_wire import PATIENT, Driven
from test.nodes.warm import Bench

STIFFNESS = load_rig("paper_high_impedance")["spring.stiffness"]


@pytest.fixture(scope="module")
def wire(tmp_path_factory, start, listener):
    with Bench(tmp_path_factory.mktemp("encoder") / "tty", "--deflection") as bench:
        yield Driven(bench, listener, "felt", start, PATIENT | {"latency": 0.02})


def test_ft_and_deflection_come_from_the_encoder_and_are_marked_as_such(wire, listener):
    wrenches = listener.hear(WrenchStamped, "/felt/ft", MEASUREMENT)
    deflections = listener.hear(JointState, "/felt/deflection", MEASUREMENT)
    wire.drive()
    wire.push(lambda: len(wrenches) > 50 and 8.0 < wrenches[-1].wrench.torque.z < 12.0)
    assert wrenches[-1].header.frame_id == deflections[-1].header.frame_id == "spring_deflection"
    angles = {stamp_of(m.header.stamp): m.position[0] for m in deflections}
    torques = {stamp_of(m.header.stamp): m.wrench.torque.z for m in wrenches}
    both = angles.keys() & torques.keys()
    assert len(both) > 20, "a busy listener loses some of each"
    for at in both:
        assert torques[at] == pytest.approx(STIFFNESS * angles[at], rel=1e-9)
    source = f"stiffness of {STIFFNESS:.4g} N·m/rad times measured deflection"
    wire.push(lambda: wire.value("ft_source") == source)


def test_the_loss_of_the_encoder_ends_the_torque_until_it_is_back(wire, listener):
    try:
        for _ in range(4):
            wire.bench.ask("set", motor=1, id=IDENTITY)
            wire.drive()
            wire.bench.ask("set", motor=1, id=50)
            wire.health.clear()
            fault = listener.until(wire.latched, lambda: wire.publish(10.0))
            if "encoder ID 100" in fault:
                break  # else the motor stalled, and nothing clears that without the encoder
        assert "encoder ID 100" in fault and wire.goal()[0] == 0
        answers = [wire.trigger("clear_fault") for _ in range(3)]  # a busy machine's motor may be silent once
        assert not any(answer.success for answer in answers)
        assert any("encoder ID 100" in answer.message for answer in answers)
    finally:
        wire.bench.ask("set", motor=1, id=IDENTITY)
    wire.drive()


def test_the_limit_of_the_deflection_acts_on_the_encoder(wire, listener):
    """The joint hardly moves; only the encoder says that the spring is beyond it."""
    wire.drive()
    wire.bench.ask("set", motor=1, homing_offset=round(0.1 / 6.283185307179586 * ENCODER.counts_per_turn))
    wire.health.clear()
    wire.push(lambda: (wire.value("fault") or "").startswith("deflection: 0.1"))  # or 0.10 under torque
    assert wire.goal()[0] == 0
    wire.bench.ask("set", motor=1, homing_offset=0)
    assert wire.trigger("clear_fault").success
    wire.drive()
