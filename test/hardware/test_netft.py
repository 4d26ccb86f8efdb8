"""RDT and the calibration page: lost records are counted exactly, and other datagrams are refused."""

import math
import random
import socket
import struct
import threading
import time

import pytest
from scipy import constants

from rsea_ros.hardware.netft.calibration import parse
from rsea_ros.hardware.netft.rdt import RESYNCHRONISE, RdtRecord, Sequence, decode, request, trouble
from rsea_ros.hardware.netft.receiver import DatagramReceiver
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
    calibration = parse(PAGE.format(*counts, *units).encode())
    expected = (force, 2 * force, 3 * force, torque, 2 * torque, 3 * torque)
    assert calibration.wrench((1, 2, 3, 1, 2, 3)) == pytest.approx(expected)
    assert math.isnan(calibration.rate)


@pytest.mark.parametrize(
    ("unit", "newton_metres"),
    [
        ("N-m", 1.0), ("Nm", 1.0), ("N-mm", 1e-3), ("Nmm", 1e-3), ("kN-m", 1e3), ("kNm", 1e3),
        ("lbf-in", constants.lbf * constants.inch), ("lbf-ft", constants.lbf * constants.foot),
        ("kgf-cm", constants.kgf * 0.01), ("kgfcm", constants.kgf * 0.01),
    ],
)  # fmt: skip
def test_a_torque_is_in_the_unit_that_the_sensor_names(unit, newton_metres):
    calibration = parse(PAGE.format(1000, 1000, "kgf", unit).encode())
    assert calibration.torque == pytest.approx(1e-3 * newton_metres, rel=1e-12)
    assert calibration.force == pytest.approx(1e-3 * constants.kgf, rel=1e-12)


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
    thread = threading.Thread(target=lambda: decoded.extend(receiver.collect(0.2)))
    thread.start()
    sent = taken = 0
    while thread.is_alive():
        sent += 1
        sensor.sendto(datagram(sent), client)
        taken += len(receiver.take())
        if sent % 50 == 0:  # a socket holds only so many
            until_heard(receiver, sent)
    until_heard(receiver, sent)
    taken += len(receiver.take())
    assert taken == sent and len(decoded) > 1


def test_a_new_stream_after_which_only_the_sensors_own_counter_has_moved_on_is_followed():
    sequence = Sequence()
    assert sequence.accept(decode(datagram(1)))
    sequence.begin()
    records = [decode(datagram(k))._replace(ft_sequence=(1 << 22) + k) for k in range(1, 9)]
    assert [sequence.accept(r) for r in records][-1]
