"""The layouts for live topics show topics that the nodes publish, and publish none themselves."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree as XML

from rsea_ros.nodes.record import TOPICS

LAYOUTS = Path(__file__).resolve().parents[3] / "config" / "layouts"
LIVE = {name if name.startswith("/") else f"/rsea/{name}" for name in TOPICS}


def test_foxglove_listens_to_topics_that_exist():
    text = (LAYOUTS / "foxglove_live.json").read_text()
    panels = json.loads(text)["configById"]
    values = re.findall(r'"(?:value|path|topicToRender)": "(/[^".]+)', text)
    assert len(values) == 8 and set(values) <= LIVE
    assert {name.partition("!")[0] for name in panels} == {"Plot", "Indicator", "DiagnosticSummary"}
    placed = set(re.findall(r'"(?:first|second)": "([^"]+)"', text))
    assert placed == set(panels)


def test_plotjuggler_subscribes_to_what_it_draws():
    root = XML.parse(LAYOUTS / "plotjuggler_live.xml").getroot()
    topics = {t.get("name") for t in root.iter("topic")}
    assert topics <= LIVE | {"/rsea/pure_torque_stamped"}
    assert {c.get("name").split("/")[2] for c in root.iter("curve")} == {t.split("/")[2] for t in topics}
