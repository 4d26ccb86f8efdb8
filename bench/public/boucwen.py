"""Bouc-Wen: a simulated hysteretic oscillator, by the rig whose spring has the general law of hysteresis.

White box: the law that made the data is the law that is fitted, so this tests the simulation and the solver.
Metric of the benchmark: RMS error in m, of the multisine in its steady state, of the sweep from rest. The
test multisine is one period: it is simulated twice and scored the second time.

The lock has no HDF5 library: `arrays` reads 64-bit floats of the old format in one piece, as the benchmark
has them. Source: HDF5 File Format Specification 3.0, sections II.A, III.A to III.D, IV.A.
"""

import struct
from itertools import product
from pathlib import Path

import numpy as np

from bench.public.fit import DATA, RIGS, Score, case_of, error_of, fit_rig, record_of, rig_of
from rsea_ros.model.rig import EffectSetting, Rig
from rsea_ros.model.rig_file import load_rig
from rsea_ros.records.record import FloatArray, Record

RATE, TORQUE = 750.0, 0.2
SETTLED, TRIED = 300, 4096
PUBLISHED = {
    "multisine": ("best found 7.5e-6, PNLSS 1.87e-5, dynoNet 4.5e-5, linear 1.75e-4", 6.5e-6),
    "sine sweep": ("none at hand", 3.1e-6),
}

_ROOT, _ENTRY, _LAYOUT, _CONTINUED, _GROUP_CACHED = 56, 40, 0x8, 0x10, 1


def scores() -> list[Score]:
    """Return the two tests of a rig that was fitted to the training record."""
    train, test = (arrays(DATA / "boucwen" / f"{name}.h5") for name in ("train", "test"))
    rig = _rig(record_of(TORQUE * train["multisine/u"], train["multisine/y"], RATE))
    u, y = (np.tile(test[f"multisine/{n}"], 2) for n in "uy")
    errors = {
        "multisine": error_of(rig, record_of(TORQUE * u, y, RATE), skip=len(u) // 2),
        "sine sweep": error_of(rig, record_of(TORQUE * test["sinesweep/u"], test["sinesweep/y"], RATE)),
    }
    return [Score(f"Bouc-Wen, {n}", e, "m", *PUBLISHED[n]) for n, e in errors.items()]


def _rig(record: Record) -> Rig:
    """Return the rig fitted to a record, from the best of a few coarse sizes of its hysteresis."""
    begun = load_rig(RIGS / "bouc_wen.yaml")
    start = record.between(record.start, record.start + TRIED / RATE)
    sizes = product((2.0, 10.0), (5e-4, 2e-3), (-1.0, 0.0))
    laws = [{"torque": t, "angle": a, "gamma": g} for t, a, g in sizes]
    rigs = [begun.with_effects(EffectSetting("spring_hysteresis", law)) for law in laws]
    tried = [fit_rig(rig, [case_of(rig, start, SETTLED, refine=1)], iterations=15) for rig in rigs]
    best = rig_of(min(tried, key=lambda s: s.cost))
    return rig_of(fit_rig(best, [case_of(best, record, SETTLED)]))


def arrays(path: Path) -> dict[str, FloatArray]:
    """Return every array of a file by its name, such as `multisine/u`, flat.

    Raises ValueError for another format.
    """
    data = path.read_bytes()
    if data[:9] != b"\x89HDF\r\n\x1a\n\x00":
        raise ValueError(f"{path}: begins with {data[:9]!r}, expected an HDF5 file of format 0")
    return {
        name.strip("/"): np.frombuffer(data, "<f8", size // 8, at)
        for name, (at, size) in _walk(data, _ROOT, "").items()
    }


def _walk(data: bytes, entry: int, name: str) -> dict[str, tuple[int, int]]:
    """Return where the arrays under a symbol table entry lie and how long they are, bytes, by name."""
    header, cached = struct.unpack_from("<QI", data, entry + 8)
    if cached != _GROUP_CACHED:
        return {name: _layout(data, header)}
    tree, heap = struct.unpack_from("<QQ", data, entry + 24)
    names = struct.unpack_from("<Q", data, heap + 24)[0]
    members: dict[str, tuple[int, int]] = {}
    for node in _leaves(data, tree):
        for i in range(struct.unpack_from("<H", data, node + 6)[0]):
            child = node + 8 + i * _ENTRY
            start = names + struct.unpack_from("<Q", data, child)[0]
            word = data[start : data.index(b"\0", start)].decode()
            members |= _walk(data, child, f"{name}/{word}")
    return members


def _leaves(data: bytes, tree: int) -> list[int]:
    """Return the addresses of the symbol nodes under a tree."""
    level, count = struct.unpack_from("<BH", data, tree + 5)
    children = [struct.unpack_from("<Q", data, tree + 32 + 16 * i)[0] for i in range(count)]
    return children if level == 0 else [leaf for child in children for leaf in _leaves(data, child)]


def _layout(data: bytes, header: int) -> tuple[int, int]:
    """Return address and length of an array that is stored in one piece."""
    left, blocks = struct.unpack_from("<H", data, header + 2)[0], [header + 16]
    while left and blocks:
        at = blocks.pop(0)
        while left:
            kind, size = struct.unpack_from("<HH", data, at)
            left -= 1
            if kind == _LAYOUT and data[at + 8 : at + 10] == b"\x03\x01":
                return struct.unpack_from("<QQ", data, at + 10)
            if kind == _CONTINUED:
                blocks.append(struct.unpack_from("<Q", data, at + 8)[0])
                break
            at += 8 + size
    raise ValueError(f"object at {header}: no array in one piece, expected one")
