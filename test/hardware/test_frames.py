"""The codec of Protocol 2.0 against the maker's vectors, against the peer's own codec, and against damage."""

import itertools
import random

import pytest

from rsea_ros.hardware.dynamixel.bus import PacketHandler
from rsea_ros.hardware.dynamixel.frames import StatusFrameParser, frame, stuff, unstuff
from rsea_ros.hardware.peer import protocol2

ALPHABET = (0xFF, 0xFD, 0x00, 0x55)
VECTORS = {
    "ping ID 1": (1, "01", "19 4e"),
    "read ID 1, address 0x84, length 4": (1, "02 84 00 04 00", "1d 15"),
    "reboot ID 1": (1, "08", "2f 4e"),
    "ping status, model 1030, firmware 38": (1, "55 00 06 04 26", "65 5d"),
    "sync read 0x84, 4, IDs 1 and 2": (254, "82 84 00 04 00 01 02", "ce fa"),
    "empty status ID 1": (1, "55 00", "a1 0c"),
}


@pytest.mark.parametrize("name", VECTORS)
def test_the_makers_test_vectors_are_reproduced(name):
    identity, payload, crc = VECTORS[name]
    packet = frame(identity, bytes.fromhex(payload))
    assert packet[-2:] == bytes.fromhex(crc)
    assert packet[7:-2] == bytes.fromhex(payload)
    updated = PacketHandler().updateCRC(0, list(packet), len(packet) - 2)
    assert updated == int.from_bytes(packet[-2:], "little")


def short_payloads():
    """Yield every payload of up to 7 of the bytes that stuffing treats."""
    for length in range(8):
        yield from map(bytes, itertools.product(ALPHABET, repeat=length))


def test_stuffing_is_undone_for_every_short_payload_and_holds_no_header():
    for payload in short_payloads():
        packed = stuff(payload)
        assert unstuff(packed) == payload
        assert packed == protocol2.escape(payload) and protocol2.unescape(packed) == payload
        assert b"\xff\xff\xfd\x00" not in packed


def test_impossible_stuffing_is_refused_by_both_codecs():
    for payload in short_payloads():
        assert (unstuff(payload) is None) == (protocol2.unescape(payload) is None)


def test_the_sdks_methods_invert_each_other_where_its_own_lose_a_byte():
    handler = PacketHandler()
    for payload in (b"\x03\xff\xff\xfd\xff\xfd\xfd", b"\x03\xff\xff\xfd", b"\x03\xff\xff\xfd\xfd\x00"):
        packet = [0xFF, 0xFF, 0xFD, 0, 1, len(payload) + 2, 0, *payload, 0, 0]
        assert handler.removeStuffing(handler.addStuffing(packet)) == packet
    with pytest.raises(ValueError, match="FF FF FD inside"):
        handler.removeStuffing([0xFF, 0xFF, 0xFD, 0, 1, 6, 0, 0x55, 0xFF, 0xFF, 0xFD, 0, 0])


def test_every_short_payload_comes_through_the_receiver_byte_by_byte_and_at_once():
    receiver = StatusFrameParser()
    for payload in itertools.islice(short_payloads(), 0, None, 7):
        packet = protocol2.status(1, 0, payload)
        (whole,) = receiver.feed(packet)
        assert whole[9:-2] == payload
        pieces = [receiver.feed(packet[i : i + 1]) for i in range(len(packet))]
        assert pieces[:-1] == [[]] * (len(packet) - 1) and pieces[-1] == [whole]
    assert not receiver.rejected


def test_unstuffed_bytes_with_a_right_crc_are_refused_and_counted():
    receiver = StatusFrameParser()
    assert receiver.feed(protocol2.status(1, 0, b"\xff\xff\xfd\x07", escaped=False)) == []
    assert receiver.rejected["stuffing"] == 1


def test_the_frame_behind_a_damaged_one_is_found():
    good = protocol2.status(1, 0, b"\x01\x02")
    endless = b"\xff\xff\xfd\x00\x01\xff\xff"
    for damage in (b"\xff\xff\xfd", good[:5], b"\xff" * 5, good[:-1] + b"\x00", endless):
        assert StatusFrameParser().feed(damage + good)[-1:] == [good], damage.hex(" ")


def mutations(rng, packet):
    """Yield damage that a CRC of 16 bits detects: a burst of up to 16 bits, a frame cut short, random bytes.

    The burst lies before or in the CRC: across its border it is none, as the CRC's low byte comes first.
    """
    burst, at = rng.randrange(1, 1 << 16), rng.choice([*range(len(packet) - 3), len(packet) - 2])
    flipped = int.from_bytes(packet[at : at + 2], "big") ^ burst
    yield packet[:at] + flipped.to_bytes(2, "big") + packet[at + 2 :]
    yield packet[: rng.randrange(len(packet))]
    yield rng.randbytes(rng.randrange(40))
    yield packet[rng.randrange(1, len(packet)) :]


def test_damaged_and_random_bytes_give_no_frame_that_was_not_sent():
    rng, strings = random.Random(4), 0
    while strings < 10_000:
        packet = protocol2.status(rng.randrange(253), rng.randrange(8), rng.randbytes(rng.randrange(20)))
        for damaged in mutations(rng, packet):
            assert StatusFrameParser().feed(damaged) in ([], [packet]), damaged.hex(" ")
            strings += 1
