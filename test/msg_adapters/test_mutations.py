"""Bags mutated at random: a record comes out, or one line; nothing else ever leaves the reader."""

from __future__ import annotations

import random
import shutil
import struct

import pytest
from foreign import run_rows, write_foreign
from mcap_bytes import McapFile
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from msg_adapters import read_record
from rsea_ros.errors import RseaError
from rsea_ros.records.stamps import repair_stamps

MUTATIONS = 25
NUMBERS = (0, 1, 255, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1)
KINDS = {
    "mcap": (StoragePlugin.MCAP, CompressionMode.NONE),
    "packed chunks": (StoragePlugin.MCAP, CompressionMode.STORAGE),
    "packed messages": (StoragePlugin.MCAP, CompressionMode.MESSAGE),
    "database": (StoragePlugin.SQLITE3, CompressionMode.NONE),
}


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Return data with a bit, a byte, a number, or a stretch changed, taken out, doubled, or cut off."""
    out, at = bytearray(data), rng.randrange(len(data))
    kind = rng.randrange(6)
    if kind == 0:
        out[at] ^= 1 << rng.randrange(8)
    elif kind == 1:
        out[at] = rng.randrange(256)
    elif kind == 2:
        form = rng.choice("HIQ")
        size = struct.calcsize(form)
        out[at : at + size] = struct.pack(f"<{form}", rng.choice(NUMBERS) % 256**size)
    elif kind == 3:
        del out[at : at + rng.choice((1, 8, 100))]
    elif kind == 4:
        out[at:at] = out[at : at + rng.choice((1, 8, 100))]
    else:
        del out[at:]
    return bytes(out)


def _read_or_refuse(path) -> None:
    for strict in (True, False):
        try:
            record = read_record(path, strict=strict)
            repair_stamps(record)
        except RseaError as error:
            assert "\n" not in str(error) and len(str(error)) < 3000


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_anywhere_in_a_file_gives_a_record_or_one_line(tmp_path, kind):
    rng = random.Random(kind)
    bag = write_foreign(tmp_path / "bag", run_rows(20), *KINDS[kind])
    file = next(path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
    data = file.read_bytes()
    for _ in range(MUTATIONS):
        file.write_bytes(mutate(data, rng) or b"\0")
        _read_or_refuse(bag)
    shutil.rmtree(bag)


def test_a_fault_anywhere_in_a_chunk_whose_checksum_fits_gives_a_record_or_one_line(tmp_path):
    rng = random.Random(8)
    file = McapFile(run_rows(20))
    sound = list(file.messages)
    for _ in range(MUTATIONS):
        file.messages = list(sound)
        for _ in range(3):
            at = rng.randrange(len(sound))
            file.messages[at] = mutate(sound[at], rng)
        (tmp_path / "a.mcap").write_bytes(file.file())
        _read_or_refuse(tmp_path / "a.mcap")


def test_a_fault_anywhere_in_the_metadata_gives_a_record_or_one_line(tmp_path):
    rng = random.Random(9)
    bag = write_foreign(tmp_path / "bag", run_rows(20))
    text = (bag / "metadata.yaml").read_bytes()
    for _ in range(MUTATIONS):
        (bag / "metadata.yaml").write_bytes(mutate(text, rng))
        _read_or_refuse(bag)
