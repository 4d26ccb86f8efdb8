"""SROS 2 policies of the nodes, read from the nodes themselves: python -m rsea_ros.nodes._policies > FILE.

With names of joints, `_policies hip knee`, they are those of one driver of these joints and of the other
nodes in the namespace of each joint. Each node is made in this process with its defaults, and its topics
and services are listed. `operator` stands for a person, who may listen to everything, call every service, and
publish nothing.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as XML

import rclpy
from rclpy.executors import SingleThreadedExecutor

from msg_adapters import BagWriter
from rsea_ros.model.rig import Sensor
from rsea_ros.model.rig_file import load_rig, save_rig
from rsea_ros.nodes._run import NAMESPACE, Member
from rsea_ros.nodes.joint import KINDS, component
from rsea_ros.nodes.record import TOPICS

ENCODERS = "two_encoders.yaml"
"""A rig with an encoder on the spring whose torque can be controlled."""
PARAMETERS: Mapping[str, Mapping[str, object]] = {
    "controller": {"rig": ENCODERS},
    "driver": {"autostart": True, "rig": "sea_two_encoders"},
    "plant": {"rig": ENCODERS},
    "record": {"out": "bag"},
    "replay": {"bag": "every topic"},
    "watch": {"port": 0},
}
"""What a node needs so that it has all its topics."""
OF_A_JOINT = ("controller", "excite", "experiment", "health", "identify", "model", "record", "watch")
"""What runs in the namespace of a joint."""
OPERATOR = "operator"
Interfaces = dict[tuple[str, str], set[str]]
"""Names by what is done with them: topics publish or subscribe, services reply or request."""
Profiles = Mapping[tuple[str, str], Interfaces]
"""By namespace and name of the node."""


def main() -> int:
    """Print the policies."""
    sys.stdout.write(policies(sys.argv[1:]))
    return 0


def policies(joints: Sequence[str] = ()) -> str:
    """Return the XML of the policies of all nodes and of the operator. joints: of one driver; none: one."""
    before = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            with BagWriter("every topic") as bag:
                for name, kind in TOPICS.items():
                    bag.write(name if name.startswith("/") else f"/{NAMESPACE}/{name}", kind, 1, bytes(8))
            rig = load_rig("paper_high_impedance")
            save_rig(replace(rig, sensors={**rig.sensors, "deflection": Sensor(noise=1e-6)}), ENCODERS)
            nodes = _joints(joints) if joints else {(NAMESPACE, name): interfaces(name) for name in KINDS}
        finally:
            os.chdir(before)
    heard = {name for each in nodes.values() for name in each["topics", "publish"]}
    served = {name for each in nodes.values() for name in each["services", "reply"]}
    for (_, name), each in nodes.items():
        if name == "record":
            asked = {s for s in served if s.endswith(("/list_parameters", "/get_parameters"))}
            each["services", "request"] |= asked
    person: Interfaces = {("topics", "subscribe"): heard, ("services", "request"): served}
    return document({**nodes, (NAMESPACE, OPERATOR): person})


def _joints(joints: Sequence[str]) -> Profiles:
    """Return those of a driver of several joints, and of the other nodes once for each joint."""
    profiles = {(NAMESPACE, "driver"): interfaces("driver", joints=f"[{', '.join(joints)}]")}
    for name in OF_A_JOINT:
        each = interfaces(name)
        for joint in joints:
            namespace = f"/{NAMESPACE}/{joint}/"
            usual = f"/{NAMESPACE}/"
            profiles[f"{NAMESPACE}/{joint}", name] = {
                kind: {namespace + n.removeprefix(usual) if n.startswith(usual) else n for n in names}
                for kind, names in each.items()
            }
    return profiles


def interfaces(name: str, **parameters: object) -> Interfaces:
    """Make a node and return the full names of its topics and services."""
    given = {**PARAMETERS.get(name, {}), **parameters}
    words = [w for key, value in given.items() for w in ("-p", f"{key}:={value}")]
    with rclpy.init(args=["--ros-args", *words]):
        member = Member(component(name), SingleThreadedExecutor())
        try:
            return _ask(member.node, name)
        finally:
            member.close()


def document(profiles: Profiles) -> str:
    """Return the XML (version 0.2.0 of the schema of sros2) with an enclave for each profile."""
    policy = XML.Element("policy", version="0.2.0")
    enclaves = XML.SubElement(policy, "enclaves")
    for (namespace, name), each in profiles.items():
        enclave = XML.SubElement(enclaves, "enclave", path=f"/{namespace}/{name}")
        profile = XML.SubElement(
            XML.SubElement(enclave, "profiles"), "profile", ns=f"/{namespace}", node=name
        )
        for (plural, verb), names in each.items():
            if names:
                parent = XML.SubElement(profile, plural, {verb: "ALLOW"})
            for listed in sorted(names):
                XML.SubElement(parent, plural.removesuffix("s")).text = listed
    XML.indent(policy)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{XML.tostring(policy, encoding="unicode")}\n'


def _ask(node: Any, name: str) -> Interfaces:
    def names(ask: Callable[[str, str], Iterable[tuple[str, Any]]]) -> set[str]:
        return {topic for topic, _ in ask(name, f"/{NAMESPACE}")}

    return {
        ("topics", "publish"): names(node.get_publisher_names_and_types_by_node),
        ("topics", "subscribe"): names(node.get_subscriber_names_and_types_by_node),
        ("services", "reply"): names(node.get_service_names_and_types_by_node),
        ("services", "request"): names(node.get_client_names_and_types_by_node),
    }


if __name__ == "__main__":
    sys.exit(main())
