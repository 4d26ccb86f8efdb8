"""PacketHandler of the SDK with its wrong parts replaced, so that its transactions can be used.

txPacket of dynamixel-sdk 4.1.0 sends FF FF FD unstuffed, removeStuffing loses bytes, and rxPacket spins.
"""

from collections.abc import Callable, Sequence

from dynamixel_sdk import (
    COMM_RX_CORRUPT,
    COMM_RX_TIMEOUT,
    COMM_SUCCESS,
    COMM_TX_ERROR,
    COMM_TX_FAIL,
    Protocol2PacketHandler,
)

from rsea_ros.hardware.dynamixel import frames
from rsea_ros.hardware.dynamixel.port import SerialPort

EMPTY = 11
"""Bytes of a status packet without parameters."""


class PacketHandler(Protocol2PacketHandler):  # type: ignore[misc]  # the SDK has no types
    """Protocol 2.0; `receiver.rejected` counts damaged frames.

    expected: parameters of the reply that is waited for; one of another size answers an older request, is
    left out and counted (`stale`, `acknowledged` where it has neither parameters nor an error). None: any. A
    refusal has no parameters and is accepted.
    meanwhile: done once while the next reply is on its way.
    """

    def __init__(self) -> None:
        self.receiver = frames.StatusFrameParser()
        self.stale = self.acknowledged = 0
        self.expected: int | None = None
        self.meanwhile: Callable[[], None] | None = None
        self._frames: list[bytes] = []

    def updateCRC(self, crc_accum: int, data_blk_ptr: Sequence[int], data_blk_size: int) -> int:
        """Return the CRC of the first bytes of a block."""
        return frames.crc16(data_blk_ptr[:data_blk_size], crc_accum)

    def addStuffing(self, packet: Sequence[int]) -> list[int]:
        """Return a packet with INST and parameters stuffed and LEN put right; the CRC is not."""
        return _with_payload(packet, frames.stuff(_payload(packet)))

    def removeStuffing(self, packet: Sequence[int]) -> list[int]:
        """Return a packet with INST and parameters as they were before stuffing.

        Raises ValueError for one that no stuffing makes.
        """
        plain = frames.unstuff(_payload(packet))
        if plain is None:
            raise ValueError(f"packet {bytes(packet).hex(' ')}: FF FF FD inside, expected FF FF FD FD")
        return _with_payload(packet, plain)

    def txPacket(self, port: SerialPort, txpacket: Sequence[int]) -> int:
        """Stuff, sign and send a packet; earlier input is discarded. Raises PortLost."""
        data = frames.frame(txpacket[4], _payload(txpacket))
        if len(data) > frames.LONGEST:
            return int(COMM_TX_ERROR)
        port.clearPort()
        self.receiver.reset()
        self._frames.clear()
        sent = port.writePort(data)
        return int(COMM_SUCCESS if sent == len(data) else COMM_TX_FAIL)

    def rxPacket(self, port: SerialPort, fast_option: bool) -> tuple[bytes, int]:
        """Wait for the next status packet until the port's time is over. Raises PortLost."""
        rejected = self.receiver.rejected.total()
        meanwhile, self.meanwhile = self.meanwhile, None
        if meanwhile is not None:
            meanwhile()
        while True:
            while self._frames:
                packet = self._frames.pop(0)
                if self._answers(packet):
                    return packet, int(COMM_SUCCESS)
                self.stale += 1
                self.acknowledged += len(packet) == EMPTY and not packet[8] & 0x7F
            data = port.receive()
            self._frames += self.receiver.feed(data, raw=fast_option)
            if not data and port.isPacketTimeout():
                damaged = self.receiver.waiting or self.receiver.rejected.total() > rejected
                return b"", int(COMM_RX_CORRUPT if damaged else COMM_RX_TIMEOUT)

    def _answers(self, packet: bytes) -> bool:
        parameters, refused = len(packet) - EMPTY, packet[8] & 0x7F
        return self.expected is None or parameters == self.expected or bool(refused and not parameters)


def _payload(packet: Sequence[int]) -> bytes:
    """Return INST and parameters of a packet by its LEN."""
    return bytes(packet[frames.OVERHEAD : frames.OVERHEAD - 2 + packet[5] + (packet[6] << 8)])


def _with_payload(packet: Sequence[int], payload: bytes) -> list[int]:
    length = len(payload) + 2
    return [*packet[:5], length & 0xFF, length >> 8, *payload, *packet[-2:]]
