"""identify is asked for a diagnosis of the run that it has just heard, and stays responsive meanwhile."""

import json
from dataclasses import replace

import numpy as np
import pytest

from msg_adapters import write_record
from msg_adapters.ros import DiagnosticArray, Trigger
from rsea_ros.identification.excitation import ExcitationSettings, excitation
from rsea_ros.model.rig import EffectSetting
from rsea_ros.model.rig_file import load_rig
from rsea_ros.model.simulation import synthesize
from rsea_ros.nodes._qos import COMMAND
from rsea_ros.records.record import Channel

RIG = "paper_high_impedance"
RATE, DURATION = 280.0, 5.0
FRICTION = 3.0


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A run of a bench with Coulomb friction."""
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    command = excitation("chirp", ExcitationSettings(rate=RATE, duration=DURATION, seed=4))
    bench = load_rig(RIG).with_effects(EffectSetting("coulomb_friction", {"torque": FRICTION}))
    record = synthesize(bench, Channel(np.arange(len(command)) / RATE, command), seed=5)
    write_record(replace(record, epoch_ns=1_700_000_000_000_000_000), path)
    return path


@pytest.fixture(scope="module")
def identify(bag, start, listener, tmp_path_factory):
    """The node after it has heard the run, and its directory."""
    out = tmp_path_factory.mktemp("identify")
    node = start("quick_identify", rig=RIG, out=out, reliable=True, stay=True, quiet=1.0)
    replay = start("replay", bag=bag, rate=10.0, subscribers=1)
    listener.until(lambda: not replay.is_running())
    assert replay.wait() == 0, replay.output
    return node, out


@pytest.fixture(scope="module")
def ask(listener):
    """A function that calls a service of the node and returns the future answer."""
    clients = {}

    def call(name, node="identify"):
        service = f"/rsea/{node}/{name}"
        if service not in clients:
            clients[service] = listener.node.create_client(Trigger, service)
            listener.until(clients[service].service_is_ready)
        return clients[service].call_async(Trigger.Request())

    return call


def test_the_answer_is_the_verdict_and_other_calls_are_answered_meanwhile(identify, ask, listener):
    node, out = identify
    heard = listener.hear(DiagnosticArray, "/diagnostics", COMMAND)
    first, second = ask("diagnose"), ask("diagnose")
    listener.until(second.done)
    assert not first.done() and node.is_running()
    assert not second.result().success and "a diagnosis is under way" in second.result().message

    listener.until(first.done)
    assert first.result().success
    assert first.result().message.startswith("Coulomb friction")
    written = json.loads((out / "diagnosis" / "diagnosis.json").read_text())
    assert written["verdict"] == "explained" and written["sentence"] == first.result().message
    friction = written["causes"][0]["parameters"]["torque"]
    assert friction["value"] == pytest.approx(FRICTION, rel=0.02)
    assert {p.name for p in (out / "diagnosis").iterdir()} == {
        "diagnosis.json", "model.yaml", "overlay.mcap", "report.html"
    }  # fmt: skip

    def verdicts():
        pairs = [{v.key: v.value for v in s.values} for m in heard for s in m.status if "identify" in s.name]
        return [p for p in pairs if p.get("verdict") == "explained"]

    told = listener.until(verdicts)[0]
    assert told["causes"] == "coulomb_friction"
    assert float(told["coulomb_friction.torque"].split()[0]) == pytest.approx(FRICTION, rel=0.02)
    assert 0.9 < float(told["coulomb_friction.gain"]) < 1.0


def test_the_node_stays_until_it_is_told_to_finish(identify, ask, listener):
    node, out = identify
    assert node.is_running()
    listener.until(ask("finish").done)
    assert node.wait() == 0, node.output
    assert (out / "identification.json").exists()
