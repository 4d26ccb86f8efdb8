"""joints.yaml: strictly read, with the line, field and value of what is wrong."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from rsea_extras.fleet import JointMapError
from rsea_extras.fleet.joints import MappedJoint, load_joints

GOOD = """
defaults:
  rig: paper_high_impedance
  axis: -torque.z
joints:
  left_knee:
    bags: left/*.mcap
    namespace: /left/knee
    topics: {ft: /ati/wrench}
    joint: knee
    temperature: /left/knee/temperature
  right_knee:
    rig: my_rig.yaml
    bags: [right/a*, right/b*]
    diagnose: never
  servo: {import: so101, index: 2, bags: so101/chirp_sweep, rig: so101_joint}
"""


def joints(folder: Path, text: str) -> tuple[MappedJoint, ...]:
    (folder / "joints.yaml").write_text(text, encoding="utf-8")
    return load_joints(folder / "joints.yaml")


@pytest.fixture
def mapped(tmp_path: Path) -> tuple[MappedJoint, ...]:
    rig = Path(__file__).parents[3] / "config/rigs/prototype_knee.yaml"
    (tmp_path / "my_rig.yaml").write_text(rig.read_text(encoding="utf-8"), encoding="utf-8")
    return joints(tmp_path, GOOD)


def test_a_joint_has_its_rig_topics_and_options(mapped):
    left, right, servo = mapped
    assert left.name == "left_knee" and left.rig.startswith("name: paper_high_impedance")
    assert left.topics.topic("ft") == "/ati/wrench"
    assert left.topics.topic("joint_states") == "/left/knee/joint_states"
    assert (left.topics.joint, left.topics.axis, left.diagnose) == ("knee", "-torque.z", "misfit")
    assert left.temperature == "/left/knee/temperature"
    assert right.rig.startswith("name: prototype_knee") and right.diagnose == "never"
    assert servo.table is not None and servo.index == 2


def test_a_pattern_names_the_end_of_a_path(mapped):
    left, right, _ = mapped
    assert left.is_in("/data/2026/left/run.mcap") and left.is_in("s3://lab/left/week/run.mcap")
    assert not left.is_in("/data/left.mcap") and not left.is_in("/data/right/a1")
    assert right.is_in("/data/right/a1") and right.is_in("right/b")


def test_settings_change_with_what_changes_a_row_and_with_nothing_else(mapped, tmp_path):
    left, _, servo = mapped
    assert len({joint.settings for joint in mapped}) == 3
    other = joints(tmp_path, GOOD.replace("left_knee", "renamed").replace("left/*.mcap", "left"))[0]
    assert other.settings == left.settings
    assert joints(tmp_path, GOOD.replace("-torque.z", "torque.z"))[0].settings != left.settings
    assert joints(tmp_path, GOOD.replace("index: 2", "index: 3"))[2].settings != servo.settings


def test_a_joint_travels_to_another_process(mapped):
    for joint in mapped:
        again = pickle.loads(pickle.dumps(joint))
        assert again == joint and again.settings == joint.settings


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("namespace:", "namespaces:"), ("line 8", "unknown key 'namespaces'", "did you mean namespace?")),
        (("rig: my_rig.yaml", "rig: my_rigg.yaml"), ("line 13", "joints.right_knee.rig", "my_rigg.yaml")),
        (("bags: left/*.mcap", 'date: "%Q"'), ("line 7", "date = '%Q'", "such as %Y-%m-%d")),
        (("topics: {ft:", "topics: {force:"), ("line 9", "'force'", "torque_command")),
        (("  rig: paper_high_impedance\n", ""), ("line 5", "joints.left_knee", "no rig")),
    ],
)
def test_a_mistake_is_reported_with_its_line(mapped, tmp_path, change, said):
    assert change[0] in GOOD
    with pytest.raises(JointMapError) as caught:
        joints(tmp_path, GOOD.replace(*change, 1))
    assert str(caught.value).startswith(str(tmp_path / "joints.yaml"))
    for word in said:
        assert word in str(caught.value)


def test_the_tables_of_the_docs_are_those_of_the_keys():
    from rsea_extras.fleet.joints import tables

    page = (Path(__file__).parents[3] / "docs/fleet.md").read_text(encoding="utf-8")
    assert tables() in page
