"""Every format that is read: well-formed files to begin with, the damage to them, and their reader.

Damaged files come in batches, each a child that makes and reads them one after another. It keeps each file
that brought a new answer, and damages it further: a cheap stand-in for the coverage of code, which reaches
the code behind the first check.
"""

import gzip
import io
import json
import random
import re
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

from bench.inputs import damage
from bench.inputs.outcome import REFUSED, RESULT, RIG, WALL, Outcome, Play, Work, call, failed, limit_child
from msg_adapters import iterate, read_record, write_record
from rsea_ros.cli.simulate import parse_effect
from rsea_ros.design.motor_gear_units import catalogue
from rsea_ros.effects.catalogue import catalogue as effects
from rsea_ros.effects.effect import Effect
from rsea_ros.errors import RseaError
from rsea_ros.hardware.netft.calibration import parse
from rsea_ros.model.rig_file import load_rig, rig_folders
from rsea_ros.nodes._joint_inputs import noise_from
from rsea_ros.records.record import Channel, Record

BATCH, SLOW, EVERY = 50, 20, 8
"""Files of a batch; s of processor for one, above which it counts as endless: all of them are small; one in
so many goes on into a verb that computes with it."""
DEEP = b"[" * 100_000
CSV = "t,phi,i,load\n" + "".join(f"{k / 100:.2f},{k % 7},{k % 11 - 5},{k}\n" for k in range(60))
MAP = """about: a bench
time: {column: t, unit: s}
where: {column: load, below: 50}
channels:
  position: {column: phi, unit: deg, sign: -1}
  command: [{column: i, unit: mA, scale: 6.8}, {column: load, unit: N m, constant: 0.5}]
"""
RATED = """delimiter: ","
time: {rate: 100}
where: {column: load, from: 3}
channels: {velocity: {column: phi, unit: rpm}, position: [{column: i, unit: mrad, scale: 1, constant: 0}]}
"""
EXPRESSED = """header: true
time: {expression: "t + 0 * i", unit: s}
runs: {column: load}
channels:
  position: {expression: "derivative(clip(phi, -3, 3)) * column('i') ** 2", unit: deg}
"""
LISTED = """time: {column: t, unit: s}
channels:
  position: {column: "q[1]", unit: deg}
  command: {expression: "i * column('q[0]')", unit: mA, scale: 3}
"""
STRUCTS = """time: {column: log.t, unit: s}
channels: {position: {column: "log.q(:,2)", unit: deg}, command: {column: log.i, unit: mA, scale: 3}}
"""
MAPS = (MAP, RATED, EXPRESSED)


def play_import(file_name: str, of_file: str = MAP, *, is_map: bool = False) -> Play:
    """Return the reader of a table with a map. is_map: the damaged file is the map."""

    def play(folder: Path, data: bytes, number: int) -> Outcome:
        table, maps = folder / file_name, folder / "map.yaml"
        table.write_bytes(CSV.encode() if is_map else data)
        maps.write_bytes(data if is_map else of_file.encode())
        return call(["import", str(table), "--map", str(maps), "--out", str(folder / f"bag{number}.mcap")])

    return play


ODD: Sequence[Any] = (
    np.arange(60, dtype="i1"), np.arange(60, dtype=">f4"), np.full(60, np.nan), np.full(60, np.inf),
    np.full(60, 10**18), np.zeros((60, 0)), np.zeros((60, 2, 2)), np.array(["x"] * 60), np.array(3.0),
    np.array([None] * 60, dtype=object), np.arange(60) * 1j, np.arange(60).astype("M8[ns]"),
    np.zeros(60, dtype=[("a", "f8"), ("b", "i2")]), np.arange(57, dtype="f2"), [True] * 60, [b"x"] * 60,
    [None if k % 2 else 1.0 for k in range(60)], [None if k % 7 else [1.0, 2.0, 3.0] for k in range(60)],
    *(pa.array(range(60), kind) for kind in (pa.timestamp("us"), pa.duration("ms"), pa.decimal128(12))),
    pa.array(["a"] * 60).dictionary_encode(),
)  # fmt: skip
"""Columns, each in the place of a good one, in files that know kinds of numbers."""


def _parquet(file: io.BytesIO, table: Mapping[str, Any], compression: str = "snappy") -> None:
    arrays = {n: y if isinstance(y, pa.Array) else pa.array(list(y)) for n, y in table.items()}
    pq.write_table(pa.table(arrays), file, row_group_size=20, compression=compression)


def tables_as(kind: str) -> list[bytes]:
    """Return the table as files of a kind, in its variants; all but `mat` have q, a matrix of two columns."""
    rows = np.array([[float(c) for c in line.split(",")] for line in CSV.splitlines()[1:]])
    plain = dict(zip(("t", "phi", "i", "load"), rows.T, strict=True))
    columns: dict[str, Any] = plain | {"q": rows[:, 1:3]}
    if kind == "json":
        texts = {name: y.tolist() for name, y in columns.items()}
        records = [dict(zip(texts, row, strict=True)) for row in zip(*texts.values(), strict=True)]
        return [json.dumps(texts).encode(), json.dumps(records).encode(), DEEP]
    odd = [{**columns, ("i", "t", "q")[k % 3]: column} for k, column in enumerate(ODD)]
    whole = {"log": {**columns, "notes": "a bench"}, "spare": np.zeros(3)}
    writers: Mapping[str, Sequence[Callable[[io.BytesIO], object]]] = {
        "npz": [lambda f: np.savez_compressed(f, **columns),
                *(lambda f, table=table: np.savez(f, **table) for table in (columns, *odd))],
        "mat": [partial(savemat, mdict=plain, **how)
                for how in ({}, {"do_compression": True}, {"format": "4"})],
        "struct": [partial(savemat, mdict=whole)],
        "parquet": [partial(_parquet, table=columns, compression="none"),
                    *(partial(_parquet, table=table) for table in (columns, *odd))],
    }  # fmt: skip
    files = []
    for write in writers[kind]:
        buffer = io.BytesIO()
        with suppress(TypeError, ValueError, pa.ArrowException):  # a format has not every kind of column
            write(buffer)
            files.append(buffer.getvalue())
    return files


@dataclass(frozen=True)
class Format:
    """name; seeds: well-formed files; spoil: makes another of one; play: reads it, in a folder."""

    name: str
    seeds: Callable[[], Sequence[bytes]]
    spoil: damage.Damage
    play: Play


def try_readers(*readers: Callable[[], object]) -> Outcome:
    """Call readers; each may succeed or refuse with an error of the package."""
    refusals = []
    for reader in readers:
        try:
            reader()
        except RseaError as error:
            refusals.append(f"{type(error).__name__}: {error}")
            if not str(error).strip() or "\n" in str(error).strip():
                return Outcome("message", f"no one line: {type(error).__name__}", repr(str(error))[:300])
    return Outcome(REFUSED, "", refusals[0]) if refusals else Outcome(RESULT)


@cache
def _bag(name: str, file: str = "") -> bytes:
    """Return a bag, or a file of one that is a folder."""
    t, rng = np.arange(400) / 280.0, np.random.default_rng(0)
    names = ("command", "motor_torque", "position", "velocity", "ft")
    channels = {n: Channel(t, rng.standard_normal(400)) for n in names}
    with TemporaryDirectory() as folder:
        write_record(Record(channels, epoch_ns=1_700_000_000_000_000_000), Path(folder) / name)
        return (Path(folder) / name / file).read_bytes() if file else (Path(folder) / name).read_bytes()


def read(
    name: str, *readers: Callable[[Path], object], often: bool = False,
    verb: Callable[[Path, str, int], list[str]] | None = None,
) -> Play:  # fmt: skip
    """Return what writes a file of a name and calls readers with it; some go on into a verb.

    often: every one that is accepted; else one in EVERY. verb: in a folder, of a file and its number: words.
    """

    def play(folder: Path, data: bytes, number: int) -> Outcome:
        file = folder / name
        file.write_bytes(data)
        outcome = try_readers(*(partial(reader, file) for reader in readers))
        if verb and (number % EVERY == 0 or (often and outcome.kind == RESULT)):
            return call(verb(folder, str(file), number))
        return outcome

    return play


def _bag_verb(folder: Path, file: str, number: int) -> list[str]:
    verb = ("predict", "identify", "diagnose")[number // EVERY % 3]
    rig = [RIG] if verb == "predict" else []
    return [verb, *rig, file, "--out", str(folder / f"out{number}")]


def _rig_verb(folder: Path, file: str, number: int) -> list[str]:
    simulated = ["simulate", file, "--out", str(folder / f"rig{number}.mcap"), "--duration", "1"]
    target = ("mjcf", "urdf", "sdf", "isaac", "bam")[number // 3 % 5]
    return (
        [*simulated, "--excitation", "white_noise"],
        ["export", f"--{target}", file, "--no-play", "--out", str(folder / f"rig{number}.out")],
        [*simulated, "--no-noise", "--excitation", "steps"],
    )[number % 3]


BAG_READERS = (
    lambda bag: read_record([bag]), lambda bag: read_record([bag], strict=False),
    lambda bag: sum(1 for _ in iterate([bag])),
)  # fmt: skip


def _play_metadata(folder: Path, data: bytes, number: int) -> Outcome:
    bag = folder / f"bag{number}"
    bag.mkdir(exist_ok=True)
    (bag / "metadata.yaml").write_bytes(data)
    (bag / "bag.mcap").write_bytes(_bag("bag.mcap"))
    (bag / f"bag{number}.mcap").write_bytes(_bag("bag.mcap"))
    return try_readers(*(partial(reader, bag) for reader in BAG_READERS[:2]))


PAGE = b"""<?xml version="1.0" encoding="utf-8"?><netft><cfgcpf>1000000</cfgcpf><cfgcpt>1000000</cfgcpt>
<scfgfu>N</scfgfu><scfgtu>Nm</scfgtu><comrdtrate>7000</comrdtrate><cfgnam>bench</cfgnam></netft>"""
BOMB = (b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">' +
        b"".join(b'<!ENTITY %c "%s">' % (98 + k, b"&%c;" % (97 + k) * 10) for k in range(9)) +
        b"]><netft><cfgcpf>&j;</cfgcpf></netft>")  # fmt: skip
BOMB_ZIP = gzip.compress(bytes(4_000_000)) * 100
"""It unpacks to 400 MB."""
NOISE = json.dumps({
    "schema": 1,
    **{n: dict.fromkeys(("ft", "position", "velocity", "motor_torque"), 0.01)
       for n in ("noise_rms", "residual_rms")},
}).encode()  # fmt: skip


def _setting(effect: Effect) -> bytes:
    return f"{effect.name}:{','.join(f'{k}={v}' for k, v in effect.typical.items())}".encode()


def _play_setting(folder: Path, data: bytes, number: int) -> Outcome:
    text = data.decode("utf-8", "surrogateescape").replace("\x00", "")
    outcome = try_readers(lambda: parse_effect(text))
    if outcome.kind != RESULT:
        return outcome
    return call(
        ["simulate", RIG, f"--effect={text}", "--duration", "0.5", "--out", str(folder / f"{number}.mcap")]
    )


def _files(folder: Path, pattern: str) -> list[bytes]:
    return [file.read_bytes() for file in sorted(folder.glob(pattern))]


FORMATS = (
    Format("mcap", lambda: [_bag("bag.mcap")], damage.in_mcap,
           read("bag.mcap", *BAG_READERS, verb=_bag_verb)),
    Format("sqlite", lambda: [*[_bag("bag.db3")] * 30, damage.bag_of_views(_bag("bag.db3"))],
           damage.in_sqlite, read("bag.db3", *BAG_READERS, verb=_bag_verb)),
    Format("metadata", lambda: [_bag("bag", "metadata.yaml")], damage.in_yaml, _play_metadata),
    Format("rig", lambda: _files(rig_folders()[0], "*.yaml"), damage.in_yaml,
           read("rig.yaml", load_rig, verb=_rig_verb, often=True)),
    Format("map", lambda: list(map(str.encode, MAPS)), damage.in_yaml, play_import("run.csv", is_map=True)),
    Format("structs.mat", lambda: tables_as("struct"), damage.in_bytes, play_import("run.mat", STRUCTS)),
    Format("npz", lambda: tables_as("npz"), damage.in_some, play_import("run.npz", LISTED)),
    Format("parquet", lambda: tables_as("parquet"), damage.in_some, play_import("run.parquet", LISTED)),
    Format("json.table", lambda: tables_as("json"), damage.in_json, play_import("run.json", LISTED)),
    Format("csv", lambda: [CSV.encode()], damage.in_table, play_import("run.csv")),
    Format("tsv", lambda: [CSV.replace(",", "\t").encode()], damage.in_table, play_import("run.tsv")),
    Format("csv.gz", lambda: [gzip.compress(CSV.encode()), BOMB_ZIP], damage.in_some,
           play_import("run.csv.gz")),
    Format("mat", lambda: tables_as("mat"), damage.in_bytes, play_import("run.mat")),
    Format("catalogue", lambda: _files(rig_folders()[0].parent / "design", "motor_gear_units.yaml"),
           damage.in_yaml, read("units.yaml", catalogue, verb=lambda folder, file, _: [
               "design", "--catalogue", file, "--out", str(folder / "design")])),
    Format("calibration", lambda: [PAGE, BOMB], damage.in_bytes,
           read("page.xml", lambda file: parse(file.read_bytes()).wrench((1, 2, 3, 4, 5, 6)))),
    Format("json", lambda: [NOISE, DEEP], damage.in_json,
           read("identification.json", lambda file: noise_from(load_rig(RIG), str(file)))),
    Format("effect", lambda: list(map(_setting, effects().values())), damage.in_setting, _play_setting),
)  # fmt: skip
SHARES = {"mcap": 5, "sqlite": 3, "metadata": 2, "rig": 5, "map": 3, "csv": 3, "mat": 3}
"""Parts of all files; one part for a format that is not named here."""


def batches(seed: int, count: int, keep: Path | None) -> Iterator[tuple[str, Work]]:
    """Yield name and work of each batch, formats by their shares and by turns. keep: for files that broke."""
    shares = [f for f in FORMATS for _ in range(SHARES.get(f.name, 1))]
    for k in range(-(-count // BATCH)):
        form, number = shares[k % len(shares)], seed * 1_000_003 + k
        yield f"{form.name} {number}", partial(_read_batch, form, number, keep)


def _read_batch(
    form: Format, seed: int, keep: Path | None, folder: Path
) -> Iterator[tuple[str, Callable[[], Outcome]]]:
    """Make and read the files of a batch; a copy stays where a promise was broken, or this process ends."""
    signal.signal(signal.SIGVTALRM, _stop)
    rng, seeds, answers = random.Random(seed), list(form.seeds()), dict[str, bytes]()
    for number in range(BATCH):
        kept = list(answers.values())
        base = rng.choice(kept) if kept and rng.random() < 0.5 else rng.choice(seeds)
        sound = number < len(seeds) and seed % 7 == 0
        data = base if sound else form.spoil(rng, base, rng.choice(seeds))
        name = f"{form.name} {seed} {number}"
        copy = (keep or folder) / name.replace(" ", "-")
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(data)
        outcomes: list[Outcome] = []
        yield name, partial(_read, form, folder, data, number, outcomes)
        for outcome in outcomes:
            pattern = re.sub(r"'[^']*'|\d+|\S*/\S*", "#", outcome.where or outcome.detail)[:120]
            answers.setdefault(outcome.kind + pattern, data)
            if not outcome.is_fault:
                copy.unlink()


def _read(form: Format, folder: Path, data: bytes, number: int, outcomes: list[Outcome]) -> Outcome:
    """Read a file within the ceilings; its outcome is noted, too."""
    limit_child(seconds=SLOW + 5)
    signal.setitimer(signal.ITIMER_VIRTUAL, SLOW)
    try:
        outcome = form.play(folder, data, number)
    except BaseException as error:
        outcome = failed(error)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        limit_child(seconds=WALL)  # the next file may take long to make
    if "_TooSlow" in outcome.where:
        outcome.kind = "time-out"
    outcomes.append(outcome)
    return outcome


class _TooSlow(BaseException):
    """Raised by the timer, past every `except Exception`."""


def _stop(number: int, frame: FrameType | None) -> None:
    raise _TooSlow(f"more than {SLOW} s")
