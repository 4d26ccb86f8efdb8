"""What excite waits for, refuses and reports, without ROS."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rsea_ros.errors import DeviceError
from rsea_ros.nodes import excite as module
from rsea_ros.nodes._health import OK, WARN
from rsea_ros.nodes.excite import PATIENCE, BenchStatus, ExciteNode, plan


@pytest.fixture
def bench(monkeypatch):
    """Return the status of a bench of two publishers, a clock, and what hears it."""
    now, heard, gone = [100.0], {}, []
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(module, "publishers_of", lambda node, topic: {"/rsea/driver", "/rsea/plant"})
    node = SimpleNamespace(
        create_subscription=lambda kind, topic, take, qos: heard.update({topic: take}) or topic,
        destroy_subscription=gone.append,
    )
    return BenchStatus(node, "hip", 8.0), now, heard, gone


def status(name="/rsea/driver", **values):
    pairs = [SimpleNamespace(key=k, value=str(v)) for k, v in values.items()]
    return SimpleNamespace(status=[SimpleNamespace(name=name, values=pairs)])


def test_commands_begin_once_the_bench_has_spoken_or_was_waited_for(bench):
    made, now, heard, gone = bench
    now[0] += 10.0
    assert not made.ready()
    heard["joint_states"](None)
    assert gone == ["joint_states"] and not made.ready()
    now[0] += PATIENCE - 0.01
    assert not made.ready()
    now[0] += 0.02
    assert made.ready()
    heard["/diagnostics"](status(active="False"))
    assert not made.ready() and made.idle == "/rsea/driver is not active; rsea call /rsea/driver activate"
    made.check(playing=False)
    with pytest.raises(DeviceError, match="is not active"):
        made.check(playing=True)
    heard["/diagnostics"](status(active="True"))
    assert made.ready()


@pytest.mark.parametrize(
    ("name", "values", "why"),
    [
        ("/rsea/driver", {"fault": "none"}, ""),
        ("/rsea/other", {"fault": "hot"}, None),
        ("/rsea/driver/knee", {"fault": "hot"}, None),
        ("/rsea/driver", {"fault": "hot"},
         "/rsea/driver has latched a fault, hot; rsea call /rsea/driver clear_fault"),
        ("/rsea/plant/hip", {"fault": "hot"},
         "/rsea/plant/hip has latched a fault, hot; rsea call /rsea/plant clear_fault"),
        ("/rsea/driver", {"torque_limit": 8.0}, ""),
        ("/rsea/driver", {"torque_limit": 7.5},
         "largest command 8 N·m, expected at most torque_limit = 7.5 N·m of /rsea/driver"),
    ],
)  # fmt: skip
def test_faults_and_limits_of_the_bench_end_a_run(bench, name, values, why):
    made, _, heard, _ = bench
    heard["/diagnostics"](status(name, **values))
    assert made.ready() == (why == "")
    if why:
        with pytest.raises(DeviceError) as error:
            made.check(playing=False)
        assert str(error.value) == why
        heard["/diagnostics"](status(name))
    made.check(playing=True)


def excite(**player):
    node, told = ExciteNode.__new__(ExciteNode), []
    timing = SimpleNamespace(values=lambda: {"late": 3})
    node._node = SimpleNamespace(get_logger=lambda: SimpleNamespace(info=lambda text, **k: told.append(text)))
    node._player = SimpleNamespace(**{
        "started": True, "next": 30, "left_out": 0, "command": np.zeros(120), "rate": 60.0,
        "subscriptions": 1, "over": lambda: True, "close": lambda: told.append("closed"),
        "cycle": SimpleNamespace(timing=lambda: timing),
    } | player)  # fmt: skip
    node._bench = SimpleNamespace(idle="", check=lambda *, playing: told.append(playing))
    node._wanted = 2
    return node, told


def test_it_tells_how_far_it_is_and_what_it_waits_for():
    node, told = excite()
    assert node.is_finished() and told == [True]
    node._tell()
    node._player.next = 500
    node._tell()
    node.close()
    assert told[1:3] == ["25% of 2.0 s", "100% of 2.0 s"]
    assert told[3:] == ["closed", "torque zero after 500 commands, 0 left out"]
    assert node._report() == (OK, "running", {"commands": 500, "left_out": 0, "late": 3})
    node, told = excite(started=False, left_out=2)
    node._tell()
    node._bench.idle = "not active"
    node._tell()
    assert told == ["waiting: 1 of 2 subscriptions of torque_command and a message on joint_states",
                    "waiting: not active"]  # fmt: skip
    assert node._report() == (WARN, "waiting for a measurement", {"commands": 30, "left_out": 2})


def test_a_plan_is_a_file_or_what_the_parameters_say(tmp_path):
    file = tmp_path / "run.csv"
    file.write_text("t,command\n" + "".join(f"{k / 50.0},{k}\n" for k in range(20)))
    command, rate = plan({"file": str(file)})
    assert rate == pytest.approx(50.0) and command.tolist() == list(range(20))
    values = {"file": "", "kind": "steps", "rate": 100.0, "duration": 4.0, "amplitude": 5.0, "noise": 0.0,
              "low": 0.1, "high": 20.0, "period": 2.0, "seed": 1, "ramp": 0.0}  # fmt: skip
    command, rate = plan(values)
    assert rate == 100.0 and len(command) == 400 and np.max(np.abs(command)) == pytest.approx(5.0)
