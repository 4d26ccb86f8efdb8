"""SROS 2 policies: they allow what the nodes do, and only the necessary ones may command torque."""

import os
from pathlib import Path
from xml.etree import ElementTree as XML

import pytest

from rsea_ros.nodes import _policies, _run
from test.nodes.warm import parent

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "config" / "security" / "policies.xml"


def test_the_committed_policies_are_those_of_the_nodes(tmp_path):
    """In a process of its own: rclpy leaves the services of a lifecycle node up, and they answer nobody."""
    files = os.devnull, tmp_path / "policies.xml", tmp_path / "said"
    for file in files[1:]:
        file.touch()
    made = parent().start("quick_policies", [], {**os.environ, "PYTHONPATH": str(ROOT)}, files)
    assert made.wait(60.0) == 0, files[2].read_text()
    assert FILE.read_bytes() == files[1].read_bytes(), "python -m rsea_ros.nodes._policies makes it anew"


@pytest.mark.parametrize(
    ("plural", "verb", "name", "allowed"),
    [
        ("topics", "publish", "/rsea/torque_command", {"controller", "excite", "experiment", "replay"}),
        ("topics", "publish", "/rsea/desired_torque", {"replay"}),
        ("topics", "publish", "/rsea/joint_states", {"driver", "plant", "replay"}),
        ("topics", "publish", "/rsea/deflection", {"driver", "plant", "replay"}),
        ("services", "request", "/rsea/driver/change_state", {"operator"}),
    ],
)
def test_only_listed_nodes_may_move_the_machine(plural, verb, name, allowed):
    profiles = {p.get("node"): p for p in XML.parse(FILE).iter("profile")}
    assert set(profiles) == {*_policies.KINDS, _policies.OPERATOR}

    def topics_of(profile):
        return [e.text for e in profile.iterfind(f"{plural}[@{verb}='ALLOW']/*")]

    assert {node for node, profile in profiles.items() if name in topics_of(profile)} == allowed


def test_joints_have_nodes_in_namespaces_that_command_their_own_joint_alone(monkeypatch):
    """A controller of one joint could be allowed the other's commands only by hand."""
    both = {"/diagnostics", "/rsea/torque_command"}
    kinds = {("topics", "publish"): both, ("services", "reply"): set()}
    driver = {("topics", "subscribe"): {"/rsea/hip/torque_command", "/rsea/knee/torque_command"}}
    monkeypatch.setattr(
        _policies, "interfaces", lambda name, **given: driver if name == "driver" else dict(kinds)
    )
    profiles = _policies._joints(("hip", "knee"))
    assert set(profiles) == {("rsea", "driver")} | {
        (f"rsea/{joint}", name) for joint in ("hip", "knee") for name in _policies.OF_A_JOINT
    }
    knee = profiles["rsea/knee", "controller"]
    assert knee["topics", "publish"] == {"/diagnostics", "/rsea/knee/torque_command"}
    paths = [e.get("path") for e in XML.fromstring(_policies.document(profiles)).iter("enclave")]
    assert "/rsea/driver" in paths and "/rsea/hip/controller" in paths


SOCKETS = "FASTDDS_BUILTIN_TRANSPORTS"


@pytest.mark.parametrize(
    ("given", "middleware", "expected"),
    [
        ({}, "rmw_fastrtps_cpp", {_run.RANGE: "SYSTEM_DEFAULT", _run.PROFILE: str(_run.HERE), SOCKETS: None}),
        (
            {_run.RANGE: "SUBNET"}, "rmw_fastrtps_cpp",
            {_run.RANGE: "SUBNET", _run.PROFILE: str(_run.ANYWHERE), SOCKETS: "UDPv4"},
        ),
        ({}, "rmw_cyclonedds_cpp", {_run.RANGE: "LOCALHOST", SOCKETS: None}),
        (
            {_run.RANGE: "LOCALHOST", _run.USERS[1]: "mine.xml"}, "rmw_fastrtps_cpp",
            {_run.RANGE: "LOCALHOST", _run.PROFILE: None},
        ),
        (
            {_run.RANGE: "LOCALHOST", "ROS_DISTRO": "iron"}, "rmw_fastrtps_cpp",
            {_run.RANGE: "LOCALHOST", _run.PROFILE: None},
        ),
    ],
)  # fmt: skip
def test_a_node_sends_by_sockets_and_stays_on_this_machine(monkeypatch, given, middleware, expected):
    """Unless the user opens it. The range as the profile says it is this machine; only Fast DDS reads it."""
    for name in (_run.RANGE, SOCKETS, "ROS_DISTRO", *_run.USERS):
        monkeypatch.setenv(name, given.get(name, ""))
        if name not in given:
            monkeypatch.delenv(name)
    monkeypatch.setattr(_run, "get_rmw_implementation_identifier", lambda: middleware)
    monkeypatch.setattr(_run.rclpy, "init", lambda **options: None)
    _run._initialise([])
    assert {name: os.environ.get(name) for name in expected} == expected


def test_the_profiles_differ_only_in_who_may_find_a_node():
    """Nobody is asked for a type: who was asked too soon was never heard (decision 381)."""
    here, anywhere = (
        [(e.tag.split("}")[1], (e.text or "").strip()) for e in XML.parse(file).iter()]
        for file in (_run.HERE, _run.ANYWHERE)
    )
    at = anywhere.index(("name", "fastdds.type_propagation"))
    assert anywhere[at + 1] == ("value", "disabled") and set(anywhere) < set(here)
    assert [text for tag, text in here if tag == "address"] == ["127.0.0.1"]
    assert "SHM" not in _run.HERE.read_text()


def test_a_node_that_cannot_be_secured_as_requested_does_not_start(tmp_path, monkeypatch):
    """Neither without security in the middleware (as in the wheels) nor with empty keys."""
    for name in ("identity_ca.cert.pem", "cert.pem", "key.pem", "permissions_ca.cert.pem", "governance.p7s",
                 "permissions.p7s"):  # fmt: skip
        (tmp_path / "enclaves" / "rsea" / "plant").mkdir(parents=True, exist_ok=True)
        (tmp_path / "enclaves" / "rsea" / "plant" / name).touch()
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", str(tmp_path))
    words, log = ["--ros-args", "--enclave", "/rsea/plant"], tmp_path / "log"
    log.touch()
    node = parent().start("rsea_ros.nodes.plant", words, dict(os.environ), [os.devnull, log, log])
    assert node.wait() == 2
    told = log.read_text().splitlines()  # rcl says before where it found the keys
    assert "FATAL" in told[-1] and "error creating node" in told[-1] and "Traceback" not in "".join(told)
