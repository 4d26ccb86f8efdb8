"""Faults of a run, read from the /diagnostics in its bag."""

import pytest
from foreign import EPOCH, header, make, raw_of, run_rows, write_foreign
from mcap_bytes import McapFile, write

from msg_adapters import read_record

SECOND = 10**9
TYPE = "diagnostic_msgs/msg/DiagnosticArray"


def status(at: int, node: str, **values):
    pairs = [make("diagnostic_msgs/msg/KeyValue", key=key, value=str(value)) for key, value in values.items()]
    one = make(
        "diagnostic_msgs/msg/DiagnosticStatus", level=0, name=node, message="", hardware_id="", values=pairs
    )
    return ("/diagnostics", at, make(TYPE, header=header(at, "frame"), status=[one]))


def _faults_of(tmp_path, *statuses, strict=True):
    bag = write_foreign(tmp_path / "bag", [*run_rows(60), *statuses])
    return {(fault.kind, fault.channel): fault for fault in read_record(bag, strict=strict).faults}


@pytest.mark.parametrize(
    ("key", "kind", "unit"),
    [
        ("left_out", "commands_left_out", "commands"),
        ("late_commands", "late_commands", "commands"),
        ("refused_commands", "refused_commands", "commands"),
        ("limited_commands", "limited_commands", "commands"),
        ("watchdog_trips", "watchdog_trips", "trips"),
        ("desired_watchdog_trips", "watchdog_trips", "trips"),
        ("lost_cycles", "lost_cycles", "cycles"),
        ("lost_messages", "lost_messages", "messages"),
    ],
)
def test_counts_that_grow_during_the_run_are_faults(tmp_path, key, kind, unit):
    rising = [status(EPOCH + k * SECOND, "/rsea/driver", **{key: 5 + k, "else": 3}) for k in range(4)]
    (fault,) = _faults_of(tmp_path, *rising, strict=unit == "trips").values()
    assert (fault.kind, fault.channel, fault.size, fault.unit) == (kind, "/rsea/driver", 3, unit)


def test_counts_of_a_node_that_starts_during_the_run_begin_at_zero(tmp_path):
    late = status(EPOCH + 5 * SECOND, "/rsea/plant", left_out=4)
    assert _faults_of(tmp_path, late)["commands_left_out", "/rsea/plant"].size == 4


@pytest.mark.parametrize("node", ["/left/driver", "/rsea/camera", "camera_driver: status", "/rsea_2/driver"])
def test_counts_and_faults_of_other_machines_and_packages_are_theirs(tmp_path, node):
    """Another machine's lost cycles were blamed on the run, and the `fault` key of any package."""
    told = [status(EPOCH + k * SECOND, node, lost_cycles=5 + k, fault="lens cap on") for k in range(4)]
    assert _faults_of(tmp_path, *told) == {}


def test_counts_of_a_node_that_restarts_begin_at_zero(tmp_path):
    counts = enumerate([10, 12, 0, 3])
    statuses = [status(EPOCH + k * SECOND, "/rsea/plant", watchdog_trips=count) for k, count in counts]
    assert _faults_of(tmp_path, *statuses)["watchdog_trips", "/rsea/plant"].size == 5


def test_faults_before_the_run_are_not_reported(tmp_path):
    values = {"left_out": 7, "fault": "none"}
    old = [status(EPOCH + k * SECOND, "/rsea/plant", missed_cycles=k, **values) for k in range(3)]
    assert _faults_of(tmp_path, *old) == {}


def test_a_latched_fault_of_the_device_is_reported(tmp_path):
    told = _faults_of(tmp_path, status(EPOCH, "/rsea/driver", fault="torque 70 N m\x1b[31m, limit 68 N m"))
    assert told["device_fault", "/rsea/driver"].detail == "torque 70 N m\ufffd[31m, limit 68 N m"


def test_diagnostics_that_are_damaged_are_counted(tmp_path):
    rows = [*run_rows(60), *(status(EPOCH + k * SECOND, "/rsea/plant", left_out=k) for k in range(5))]

    def encode(k, row):
        return raw_of(row[2])[: -20 if k == 182 else None]

    got = read_record(write(tmp_path / "a.mcap", McapFile(rows, encode=encode).file()))
    told = {(fault.kind, fault.channel): fault.size for fault in got.faults}
    assert told == {("damaged_messages", "/diagnostics"): 1, ("commands_left_out", "/rsea/plant"): 4}


def test_the_keys_are_those_that_the_nodes_publish():
    """Each key stands in the source of a node."""
    from pathlib import Path

    from msg_adapters.decoding import COUNTERS

    root = Path(__file__).resolve().parents[2] / "rsea_ros"
    sources = [path.read_text() for folder in ("nodes", "hardware") for path in (root / folder).glob("*.py")]
    for key in COUNTERS:
        stem = "failed_{transfer}s" if key.startswith("failed_") else key
        assert any(f'"{stem}"' in source for source in sources), key
