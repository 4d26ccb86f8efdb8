"""The F/T sensor: its records, counted exactly, the page of its calibration, and one that stops."""

import contextlib
import itertools
import math
import random
import socket
import struct
import threading
import time
from types import SimpleNamespace

import pytest
from scipy import constants

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.netft import calibration
from rsea_ros.hardware.netft.calibration import parse
from rsea_ros.hardware.netft.receiver import (
    HELD,
    RESYNCHRONISE,
    Arrival,
    DatagramReceiver,
    RdtRecord,
    Sequence,
    decode,
    request,
    trouble,
)
from rsea_ros.hardware.netft.sensor import Stillness
from test.nodes.stalls import until


def datagram(sequence, ft_sequence=None, status=0, values=(1, -2, 3, -4, 5, -6)):
    words = (sequence % 2**32, (sequence if ft_sequence is None else ft_sequence) % 2**32, status)
    return struct.pack(">3I6i", *words, *values)


def record(sequence, ft_sequence=None):
    return decode(datagram(sequence, ft_sequence))


def test_a_record_and_a_request_are_as_the_manual_says():
    assert request(2, 5) == bytes.fromhex("1234 0002 00000005")
    packed = "00000007 00000009 80020000 00000001 fffffffe 00000003 fffffffc 00000005 fffffffa"
    assert decode(bytes.fromhex(packed)) == RdtRecord(7, 9, 0x80020000, (1, -2, 3, -4, 5, -6))


@pytest.mark.parametrize("first", [5, 2**32 - 3])
def test_gaps_are_counted_exactly_across_the_rollover(first):
    sequence = Sequence()
    steps = [1, 1, 4, 1, 2, 1, 300]
    at = first
    assert sequence.accept(record(at))
    for step in steps:
        at += step
        assert sequence.accept(record(at))
    assert sequence.counts["lost"] == sum(step - 1 for step in steps)
    assert sequence.counts["received"] == len(steps) + 1


def test_duplicates_and_overtaken_records_are_left_out():
    sequence = Sequence()
    taken = [sequence.accept(record(n)) for n in (1, 2, 2, 4, 3, 5)]
    assert taken == [True, True, False, True, False, True]
    assert (sequence.counts["duplicate"], sequence.counts["reordered"]) == (1, 1)


def test_a_sensor_that_was_switched_off_or_stands_still_is_noticed():
    sequence = Sequence()
    assert sequence.accept(record(1, 10**9 * 3)) and sequence.accept(record(2, 10**9 * 3))
    assert sequence.counts["frozen"] == 1
    sequence.begin()
    sequence.accept(record(1, 1))
    assert sequence.counts["restarted"] == 1
    assert sequence.accept(record(2, 2))


def test_a_wild_jump_is_damage_until_others_follow_it():
    sequence = Sequence()
    sequence.accept(record(1))
    assert not sequence.accept(record(2**30))
    assert sequence.accept(record(2))
    others = [sequence.accept(record(2**30 + k, 3 + k)) for k in range(10, 10 + RESYNCHRONISE)]
    assert others == [False] * (RESYNCHRONISE - 1) + [True]
    assert sequence.counts["lost"] == 0


@pytest.mark.parametrize(
    ("status", "words"),
    [(0, ""), (0x80010000, ""), (0x80020000, "saturation"), (0x80030000, "saturation"), (1 << 31, "status")],
)
def test_status_bits_are_read_as_the_manual_says(status, words):
    assert trouble(status) == words


def test_random_and_mutated_datagrams_give_no_record_that_was_not_sent():
    """Values have no check of their own in RDT, that is UDP's; length and counters are looked at here."""
    rng, sequence = random.Random(6), Sequence()
    for at in range(1, 20_001):
        whole = datagram(at)
        assert sequence.accept(decode(whole))
        noise, cut = rng.randbytes(rng.randrange(80)), whole[: rng.randrange(36)]
        flipped = bytearray(whole)
        flipped[rng.randrange(2)] ^= 1 << rng.randrange(8)  # a step of at least 65536
        flipped[0] |= 0x40
        for damaged in (noise, cut, whole + whole[:4], bytes(flipped)):
            decoded = decode(damaged)
            assert decoded is None or not sequence.accept(decoded), damaged.hex()
    assert sequence.counts["received"] == 20_000 and sequence.counts["lost"] == 0


PAGE = "<netft><cfgcpf>{}</cfgcpf><cfgcpt>{}</cfgcpt><scfgfu>{}</scfgfu><scfgtu>{}</scfgtu></netft>"


@pytest.mark.parametrize(
    ("counts", "units", "force", "torque"),
    [
        ((1_000_000, 1000), ("N", "N-mm"), 1e-6, 1e-6),
        ((4448.2216152605, 112.9848290276167), ("lbf", "lbf-in"), 1e-3, 1e-3),
        ((1000, 1000), ("kN", "N-m"), 1.0, 1e-3),
    ],
)
def test_the_calibration_is_counts_per_unit(counts, units, force, torque):
    read = parse(PAGE.format(*counts, *units).encode())
    expected = (force, 2 * force, 3 * force, torque, 2 * torque, 3 * torque)
    assert read.wrench((1, 2, 3, 1, 2, 3)) == pytest.approx(expected)
    assert math.isnan(read.rate)


@pytest.mark.parametrize(
    ("unit", "newton_metres"),
    [
        ("N-m", 1.0), ("Nm", 1.0), ("N-mm", 1e-3), ("Nmm", 1e-3), ("kN-m", 1e3), ("kNm", 1e3),
        ("lbf-in", constants.lbf * constants.inch), ("lbf-ft", constants.lbf * constants.foot),
        ("kgf-cm", constants.kgf * 0.01), ("kgfcm", constants.kgf * 0.01),
    ],
)  # fmt: skip
def test_a_torque_is_in_the_unit_that_the_sensor_names(unit, newton_metres):
    read = parse(PAGE.format(1000, 1000, "kgf", unit).encode())
    assert read.torque == pytest.approx(1e-3 * newton_metres, rel=1e-12)
    assert read.force == pytest.approx(1e-3 * constants.kgf, rel=1e-12)


@pytest.fixture
def streamed():
    """A receiver and the socket of its sensor, with the address that asked."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:
        sensor.bind(("127.0.0.1", 0))
        sensor.settimeout(10.0)
        receiver = DatagramReceiver(*sensor.getsockname())
        receiver.open()
        asked, client = sensor.recvfrom(64)
        assert asked == request(2)
        yield receiver, sensor, client
        receiver.close()


def test_records_that_come_faster_than_they_are_read_hold_up_no_cycle():
    """At 7 kHz beside other work a cycle lasted 11 s, under torque."""
    receiver, taken = DatagramReceiver("", 0), []

    def recvmsg(*_):
        taken.append(len(taken))
        assert len(taken) < 10_000
        return datagram(len(taken)), [], 0, None

    receiver._thread, receiver._socket = threading.current_thread(), SimpleNamespace(recvmsg=recvmsg)
    receiver._keep = lambda *told: None
    receiver.drain()
    assert len(taken) == HELD


def until_heard(receiver, sequence):
    until(lambda: receiver.newest is not None and receiver.newest.record.sequence == sequence)


def test_the_socket_is_drained_and_every_record_has_the_stamp_of_its_arrival(streamed):
    receiver, sensor, client = streamed
    before = time.time_ns()
    for n in range(1, 201):
        sensor.sendto(datagram(n), client)
    after = time.time_ns()
    until_heard(receiver, 200)
    arrivals = receiver.take()
    assert [a.record.sequence for a in arrivals] == list(range(1, 201))
    stamps = [a.stamp for a in arrivals]
    assert stamps == sorted(stamps) and before <= stamps[0] and stamps[-1] <= after


def test_records_of_a_stranger_are_not_taken(streamed):
    receiver, sensor, client = streamed
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(datagram(1), client)
    sensor.sendto(datagram(77), client)
    until_heard(receiver, 77)
    assert [a.record.sequence for a in receiver.take()] == [77]


def test_a_stream_that_falls_silent_is_requested_again(streamed):
    receiver, sensor, client = streamed
    sensor.sendto(datagram(9, 9), client)
    assert sensor.recvfrom(64)[0] == request(2)
    until(lambda: receiver.newest is not None)
    sensor.sendto(datagram(1, 20), client)
    until(lambda: receiver.newest.record.ft_sequence == 20)
    assert receiver.sequence.counts["lost"] == 0


def test_a_tare_collects_while_the_cycle_reads(streamed):
    """Tare and cycle took from one queue, and the second of them raised IndexError."""
    receiver, sensor, client = streamed
    decoded = []
    thread = threading.Thread(target=lambda: decoded.extend(receiver.collect(1.0)))
    thread.start()
    taken = 0
    for sent in range(1, 501):
        sensor.sendto(datagram(sent), client)
        taken += len(receiver.take())
        if sent % 50 == 0:  # a socket holds only so many
            until_heard(receiver, sent)
    thread.join()
    taken += len(receiver.take())
    assert taken == 500 and len(decoded) > 1


def test_a_new_stream_after_which_only_the_sensors_own_counter_has_moved_on_is_followed():
    sequence = Sequence()
    assert sequence.accept(record(1))
    sequence.begin()
    assert [sequence.accept(record(k, (1 << 22) + k)) for k in range(1, 9)][-1]


MS = 1_000_000


def records(values, start=0):
    """Records 1 ms apart whose last torque has these counts."""
    rows = ((k, RdtRecord(k, k, 0, (0, 0, 0, 0, 0, value))) for k, value in enumerate(values))
    return [Arrival(0, row, start + k * MS) for k, row in rows]


def stillness(rest):
    made = Stillness()
    made.calibrate(records(rest))
    return made


@pytest.mark.parametrize(
    ("rest", "limit"),
    [
        ([0, 1] * 50, 50 * MS),
        ([0] * 8 + [1] * 8 + [0] * 84, 80 * MS),  # a quiet sensor repeats its values
        ([7] * 100, math.inf),  # one without noise always may
        ([7], math.inf),
        ([], math.inf),
    ],
)
def test_the_limit_is_ten_times_the_longest_rest_of_its_values(rest, limit):
    assert stillness(rest).limit == limit


def test_values_that_stop_are_a_fault_until_they_change():
    sensor = stillness([0, 1] * 50)
    assert sensor.take(records([5, *[9] * 50], start=1000 * MS)) == ""
    assert not sensor.stopped
    told = sensor.take(records([9] * 10, start=1052 * MS))
    assert told == "all six values unchanged for 60 ms: the sensor has stopped" and sensor.stopped
    assert sensor.take([]) == "" and sensor.stopped
    assert sensor.reason(records([9] * 100)) == "all six values unchanged for 99 ms: the sensor has stopped"
    assert sensor.reason(records([9] * 50 + [8] * 50)) == ""
    sensor.restart()
    assert not sensor.stopped and sensor.take(records([9] * 40, start=2000 * MS)) == ""


GOOD = (
    b"<?xml version='1.0'?><netft><cfgcpf>1000000</cfgcpf><cfgcpt>1000</cfgcpt>"
    b"<scfgfu>N</scfgfu><scfgtu>N-mm</scfgtu><comrdtrate>7000</comrdtrate></netft>"
)
HEAD = b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\n"
LAUGHS = b"<!DOCTYPE l [<!ENTITY a0 'ha'>%s]><l>&a9;</l>" % b"".join(
    b"<!ENTITY a%d '%s'>" % (k, b"&a%d;" % (k - 1) * 10) for k in range(1, 10)
)


@contextlib.contextmanager
def serve(*parts, pause=0.0):
    """Serve one connection: parts of bytes with pauses between them; yield port and the request."""
    requests, over = [], threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def run():
            connection, _ = listener.accept()
            with connection, contextlib.suppress(OSError):
                requests.append(connection.recv(4096))
                for part in itertools.chain(*parts):
                    connection.sendall(part)
                    if over.wait(pause):
                        break

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        yield listener.getsockname()[1], requests
        over.set()
        thread.join(5.0)


def whole(body, head=HEAD):
    return [head + b"Content-Length: %d\r\n\r\n" % len(body), body]


def test_a_sensor_that_answers_gives_its_calibration():
    with serve(whole(GOOD)) as (port, requests):
        read = calibration.fetch("127.0.0.1", port)
    assert (read.force, read.torque, read.rate) == (1e-6, 1e-6, 7000.0)
    assert requests[0].startswith(b"GET /netftapi2.xml HTTP/1.1\r\nHost: 127.0.0.1:")


FIELDS = {
    **{f"<setuserfilter>{n}</setuserfilter>": ("low_pass", n) for n in ("8", "0", "")},
    **{f"<setuserfilter>{n}</setuserfilter>": ("low_pass", "") for n in ("&lt;b&gt;", "-1", "9999")},
    "<cfgmr>700;700;1700;30000;30000;30000</cfgmr>": ("range", 30.0),
    "<cfgmr>700, 700, 1700, 30000, 30000, 30000</cfgmr>": ("range", 30.0),
    **dict.fromkeys(("", "<cfgmr>700;700</cfgmr>", "<cfgmr>0;0;0;0;0;0</cfgmr>"), ("range", math.inf)),
}
"""What a page may state beside the calibration: a low pass, ranges of which the last counts."""


@pytest.mark.parametrize("field", FIELDS)
def test_low_pass_and_range_are_read_where_the_page_states_them(field):
    name, known = FIELDS[field]
    read = parse(GOOD.replace(b"</netft>", field.encode() + b"</netft>"))
    assert read.low_pass == known if name == "low_pass" else read.range[5] == pytest.approx(known)
    assert parse(GOOD).low_pass == ""


def test_a_page_in_pieces_and_without_a_length_is_read():
    with serve([HEAD + b"\r\n", GOOD[:50], GOOD[50:]], pause=0.01) as (port, _):
        assert calibration.fetch("127.0.0.1", port).force == 1e-6
    chunks = [b"%x\r\n%s\r\n" % (len(part), part) for part in (GOOD[:50], GOOD[50:])]
    with serve([HEAD + b"Transfer-Encoding: chunked\r\n\r\n", *chunks, b"0\r\n\r\n"]) as (port, _):
        assert calibration.fetch("127.0.0.1", port).force == 1e-6


REFUSED = {
    "redirect": (
        [b"HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n"],
        "status 302 Found, expected its calibration",
    ),
    "missing": ([b"HTTP/1.1 404 Not Found\r\n\r\n"], "status 404 Not Found"),
    "closed": ([b""], "Remote end closed connection"),
    "cut": ([HEAD + b"Content-Length: 999\r\n\r\n", GOOD], r"\d+ bytes are missing at its end"),
    "bad chunks": ([HEAD + b"Transfer-Encoding: chunked\r\n\r\nzz\r\n"], "expected its calibration"),
    "many headers": ([HEAD, b"X-A: b\r\n" * 1000], "got more than 100 headers"),
    "laughs": (whole(LAUGHS), "not XML .entity 'a0' declared"),
    "outside entity": (
        whole(b"<!DOCTYPE l [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><l>&a;</l>"),
        "not XML .entity 'a' declared",
    ),
    "empty": (whole(b""), "not XML .no element"),
    "other xml": (whole(b"<svg/>"), "scfgfu = '', expected one of N, kN"),
    "tiny": (whole(GOOD.replace(b"1000000", b"1e-300")), "cfgcpf = '1e-300', expected a number above 0"),
    "long": (whole(GOOD.replace(b"1000000", b"9" * 9999)), "cfgcpf = '9999"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_page_without_a_calibration_is_one_line(case):
    parts, message = REFUSED[case]
    with serve(parts) as (port, _), pytest.raises(DeviceError, match=message) as caught:
        calibration.fetch("127.0.0.1", port)
    assert f"http://127.0.0.1:{port}/netftapi2.xml" in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


@pytest.mark.parametrize(
    ("head", "drop"), [([HEAD + b"\r\n"], b" "), ([b""], b"")], ids=["dripping body", "silence"]
)
def test_a_page_that_drips_ends_in_time(head, drop):
    sent = []
    page = serve(head, (sent.append(drop) or drop for _ in range(500)), pause=0.02)  # 10 s
    with page as (port, _), pytest.raises(DeviceError, match=r"no whole answer within 0.2 s"):
        calibration.fetch("127.0.0.1", port, timeout=0.2)
    assert len(sent) < 60, "in 1.2 s at least"


def test_an_endless_page_is_abandoned_at_the_size_limit(monkeypatch):
    monkeypatch.setattr(calibration, "LARGEST", 1000)
    endless = serve([HEAD + b"\r\n"], itertools.repeat(b" " * 500))
    with endless as (port, _), pytest.raises(DeviceError, match="more than 1000 bytes"):
        calibration.fetch("127.0.0.1", port)


def test_a_sensor_that_does_not_answer_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(DeviceError, match=r"Connection refused"):
        calibration.fetch("127.0.0.1", port)
