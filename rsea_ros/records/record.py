"""Record: the time series of one run, in SI units, frozen: the only data type between the layers."""

from __future__ import annotations

import copyreg
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from rsea_ros.documents.units import plain
from rsea_ros.errors import ChannelError, ParameterError

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
ComplexArray = npt.NDArray[np.complex128]

NONSENSE = 10.0
"""Times its limit from which on a torque is no large one but an error: N mm for N m is 1000 times it."""
HUGE = 1e6
"""N m, rad, rad/s, of no actuator: what is beyond was not measured, where no limit is known."""


def frozen(mapping: Mapping[Any, Any]) -> MappingProxyType[Any, Any]:
    """Return a mapping that cannot be changed; it goes to other processes as rigs and records do."""
    return MappingProxyType(mapping)


copyreg.pickle(MappingProxyType, lambda mapping: (frozen, (dict(mapping),)))


def is_measured(value: float | None, most: float = math.inf) -> bool:
    """Return whether there is a value: None, not-a-number, infinity and what is beyond `most` are none."""
    return value is not None and math.isfinite(value) and abs(value) <= most


UNITS: Mapping[str, str] = {
    "command": "N m",
    "motor_torque": "N m",
    "position": "rad",
    "velocity": "rad/s",
    "ft": "N m",
    "deflection": "rad",
    "reference": "rad",
    "reference_velocity": "rad/s",
}
"""Channel names and their units.

command       commanded motor torque at the gear output; it takes effect at its stamp
motor_torque  motor torque from the measured current, at the gear output
position      gear output relative to the housing
velocity      rate of the position
ft            torque of the F/T sensor about the actuator axis, positive when the spring pushes
              the distal side forward
deflection    angle of the spring from a separate encoder, positive when the spring pushes the distal side
              forward
reference     target position of a controller that was active during the record
reference_velocity  target velocity of such a controller
"""

COMMANDS = ("command", "reference", "reference_velocity")
"""Channels that say what was asked; all others were measured."""

SENSED = ("ft", "deflection", "position", "velocity")
"""Channels that a verdict uses, in the order in which it names them."""
MEASURED = (*SENSED, "motor_torque")
"""All channels that a fit sees. The motor torque repeats the command: a verdict uses it as the only one."""


@dataclass(frozen=True)
class Channel:
    """Values of one quantity with their stamps.

    t: seconds since the record's epoch, shape (n,), as recorded (a fault may put them out of order).
    y: values in the unit of UNITS, shape (n,), as recorded (may hold NaN).
    """

    t: FloatArray
    y: FloatArray

    def __post_init__(self) -> None:
        if self.t.shape != self.y.shape or self.t.ndim != 1:
            raise ChannelError(
                f"stamps of shape {self.t.shape} for values of shape {self.y.shape}, expected equal (n,)"
            )
        for name in ("t", "y"):
            frozen = getattr(self, name).view()
            frozen.flags.writeable = False
            object.__setattr__(self, name, frozen)

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def rate(self) -> float:
        """Sample rate, Hz, gaps aside; NaN for a single sample, infinite where most stamps repeat.

        It is that of the mean interval of about the median's length: rounded stamps have few lengths.
        """
        if len(self) < 2:
            return math.nan
        interval = np.diff(self.t)
        median = float(np.median(interval))
        usual = interval[np.abs(interval - median) <= 0.5 * abs(median)]
        period = float(np.mean(usual)) if len(usual) else median
        return 1.0 / period if median else math.inf

    @property
    def is_still(self) -> bool:
        """Whether all finite values are equal."""
        finite = self.y[np.isfinite(self.y)]
        return not len(finite) or bool(np.all(finite == finite[0]))

    def between(self, start: float, stop: float) -> Channel:
        """Return the samples with start <= t < stop (s)."""
        keep = (self.t >= start) & (self.t < stop)
        return Channel(self.t[keep], self.y[keep])

    def held(self, t: FloatArray) -> FloatArray:
        """Return the newest value at each instant, s; before the first one that."""
        return self.y[np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self) - 1)]


@dataclass(frozen=True)
class Fault:
    """A defect of the data, found before any fit.

    kind: one of fault_kinds.FAULT_KINDS.
    channel: the channel, or the topic or file where no channel is known.
    share: of the samples of the channel, 0 to 1; NaN if the fault does not concern single samples.
    size: in `unit`, if the fault has a size. detail: place and description in words.
    """

    kind: str
    channel: str
    share: float
    detail: str = ""
    size: float | None = None
    unit: str = ""


IMPORTED = "imported from "
"""How the note begins that an import leaves with the record of a table."""


@dataclass(frozen=True)
class Record:
    """One run: channels by name (see UNITS), and their origin.

    epoch_ns: the stamp that is t = 0, nanoseconds since the epoch of the recording clock.
    source: path or topic prefix, for messages. notes: repairs and assumptions. faults: damage found while
    reading; every result made from the record repeats it. keeps_rows: no row is left out for its stamps.
    """

    channels: Mapping[str, Channel]
    source: str = ""
    epoch_ns: int = 0
    notes: tuple[str, ...] = field(default=())
    faults: tuple[Fault, ...] = field(default=())
    keeps_rows: bool = False

    def __post_init__(self) -> None:
        unknown = set(self.channels) - set(UNITS)
        if unknown:
            raise ChannelError(
                f"{self.source}: unknown channel {sorted(unknown)[0]!r}, expected one of {', '.join(UNITS)}"
            )
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))

    @classmethod
    def from_arrays(cls, t: npt.ArrayLike, *, source: str = "arrays", **channels: npt.ArrayLike) -> Record:
        """Return a record of channels that share their stamps; the arrays are copied.

        t: stamps, s, shape (n,), increasing. A command takes effect at its stamp and holds; a measurement was
        taken at its stamp. So one row of a control loop that reads and then commands has one stamp.
        channels: values by name of UNITS (or an alias such as `q`, `u`, `tau`), in SI, shape (n,): arrays,
        lists or columns of a table; NaN or masked for a missing measurement.
        Raises ChannelError for an unknown name, a wrong shape, values that are not real numbers, stamps that
        do not increase, and stamps or commands that are not finite.
        """
        return record_from_arrays(t, source, channels)

    @classmethod
    def from_dataframe(
        cls, table: Any, columns: Mapping[str, str], *, time: str = "t", source: str = "table"
    ) -> Record:
        """Return a record from the columns of a table (pandas, Polars, or any mapping of columns).

        columns: the column of each channel, `{"command": "tau_cmd", "ft": "tau_ft"}`. time: the column of
        the stamps, s. Raises ChannelError as from_arrays does, and for a column that the table lacks.
        """
        series = {name: _column(table, column, source) for name, column in {"t": time, **columns}.items()}
        return record_from_arrays(series.pop("t"), source, series)

    def to_frame(self) -> Any:
        """Return a DataFrame: a column for each channel, over all stamps, s; NaN where one has no sample.

        Of samples with the same stamp the last is kept. Raises ParameterError without pandas.
        """
        pandas = pandas_for("to_frame")
        columns = {name: pandas.Series(c.y, c.t) for name, c in self.channels.items()}
        return pandas.DataFrame({n: c[~c.index.duplicated(keep="last")] for n, c in columns.items()})

    def __repr__(self) -> str:
        """Return source, duration and the rate of each channel in one line."""
        rates = ", ".join(f"{name} {channel.rate:.4g} Hz" for name, channel in self.channels.items())
        return f"Record({self.source!r}, {self.stop - self.start:.4g} s: {rates})"

    def __contains__(self, name: str) -> bool:
        return name in self.channels

    def __getitem__(self, name: str) -> Channel:
        try:
            return self.channels[name]
        except KeyError:
            have = ", ".join(self.channels) or "none"
            raise ChannelError(f"{self.source}: no channel {name!r}, expected it beside: {have}") from None

    @property
    def driving(self) -> Channel | None:
        """The commands of the run: torques, else target positions; None without either."""
        return self.channels.get("command", self.channels.get("reference"))

    @property
    def start(self) -> float:
        """First stamp of any channel, s."""
        return min(float(c.t[0]) for c in self.channels.values() if len(c))

    @property
    def stop(self) -> float:
        """Last stamp of any channel, s."""
        return max(float(c.t[-1]) for c in self.channels.values() if len(c))

    @property
    def is_table(self) -> bool:
        """Whether an import made it of a table, whose map then says what a bag's options would."""
        return any(note.startswith(IMPORTED) for note in self.notes)

    @property
    def naming(self) -> str:
        """How to say which of the recorded quantities a channel is, for a remedy."""
        return "name its column in the import map" if self.is_table else "name its topic with --topic"

    def between(self, start: float, stop: float) -> Record:
        """Return the record restricted to start <= t < stop (s); stamps keep their origin."""
        return replace(self, channels={k: c.between(start, stop) for k, c in self.channels.items()})

    def with_channels(self, **channels: Channel) -> Record:
        """Return the record with some channels added or replaced."""
        return replace(self, channels={**self.channels, **channels})


ALIASES: Mapping[str, str] = {
    "u": "command",
    "torque_command": "command",
    "tau_m": "motor_torque",
    "q": "position",
    "dq": "velocity",
    "qd": "velocity",
    "tau": "ft",
    "tau_d": "ft",
    "q_ref": "reference",
    "target_position": "reference",
    "dq_ref": "reference_velocity",
    "target_velocity": "reference_velocity",
    "q_spring": "deflection",
}
"""Other names that people give to the channels of signals.UNITS."""

FEWEST = 2
"""Samples of a channel: fewer have no rate."""

_NO_NUMBERS = "cbmMSUV"
"""Kinds of numpy arrays that numpy would turn into numbers that nobody meant."""


class NamedColumns(Protocol):
    """A table with named columns, such as a pandas or Polars DataFrame."""

    def __getitem__(self, name: str, /) -> Any: ...


def pandas_for(purpose: str) -> Any:
    """Return pandas. Raises ParameterError where it is not installed."""
    try:
        return import_module("pandas")
    except ImportError:
        words = f"{purpose}: pandas is not installed, expected it (pip install pandas)"
        raise ParameterError(words) from None


def record_from_arrays(t: npt.ArrayLike, source: str, channels: Mapping[str, npt.ArrayLike]) -> Record:
    """Return a record as `Record.from_arrays` does, of channels whatever their names."""
    stamps = _vector("t", t, source)
    values = {_channel(name, source): _vector(name, y, source) for name, y in channels.items()}
    if len(values) < len(channels):
        raise ChannelError(f"{source}: {', '.join(channels)} name a channel twice, expected each once")
    if not values:
        raise ChannelError(f"{source}: no channel, expected one or more of {', '.join(UNITS)}")
    for name, y in values.items():
        if y.shape != stamps.shape:
            raise ChannelError(f"{source}: {name} has {len(y)} values for {len(stamps)} stamps in t")
    _check_finite("t", "s", stamps, source)
    wrong = np.flatnonzero(~(np.diff(stamps) > 0.0))
    if len(wrong):
        k = int(wrong[0]) + 1
        raise ChannelError(
            f"{source}: t[{k}] = {stamps[k]:g} s after {stamps[k - 1]:g} s, expected stamps that rise"
        )
    if "command" in values:
        _check_finite("command", UNITS["command"], values["command"], source)
    return Record({name: Channel(stamps - stamps[0], y) for name, y in values.items()}, source)


def _channel(name: str, source: str) -> str:
    channel = ALIASES.get(name, name)
    if name == "torque":
        raise ChannelError(f"{source}: 'torque' may be three channels, expected command, motor_torque or ft")
    if channel not in UNITS:
        known = ", ".join((*UNITS, *ALIASES))
        raise ChannelError(f"{source}: unknown channel {name!r}, expected one of {known}")
    return channel


def _vector(name: str, values: npt.ArrayLike, source: str) -> FloatArray:
    """Return the values of a channel, or of `t`, as a copy in doubles, NaN where masked.

    Raises ChannelError for values that are not real numbers, or not of shape (n,) with n >= 2.
    """
    try:
        given: Any = np.ma.asarray(values)
        numbers = given if given.dtype.kind in _NO_NUMBERS else given.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise ChannelError(f"{source}: {name} is not an array of numbers: {error}") from None
    if numbers.dtype.kind in _NO_NUMBERS:
        unit = "s" if name == "t" else UNITS[_channel(name, source)]
        raise ChannelError(f"{source}: {name} holds {numbers.dtype}, expected real numbers in {plain(unit)}")
    if numbers.ndim != 1 or len(numbers) < FEWEST:
        raise ChannelError(
            f"{source}: {name} has shape {numbers.shape}, expected (n,) with n >= {FEWEST} samples"
        )
    return np.asarray(numbers.filled(np.nan))


def torques_from(name: str, values: npt.ArrayLike, fewest: int) -> FloatArray:
    """Return torques at the samples, N m, shape (n,). Raises ParameterError for what is none, or too few."""
    given = np.asarray(values)
    is_vector = given.dtype.kind in "iuf" and given.ndim == 1
    if not (is_vector and len(given) >= fewest and np.isfinite(given).all()):
        expected = f"(n,) finite torques in N·m with n >= {fewest} samples"
        raise ParameterError(f"{name}: shape {given.shape} of {given.dtype}, expected {expected}")
    return given.astype(np.float64)


def _check_finite(name: str, unit: str, values: FloatArray, source: str) -> None:
    for k in np.flatnonzero(~np.isfinite(values))[:1]:
        raise ChannelError(f"{source}: {name}[{k}] = {values[k]}, expected a finite value in {plain(unit)}")


def _column(table: NamedColumns, column: str, source: str) -> Any:
    try:
        return table[column]
    except (KeyError, IndexError, ValueError) as error:
        have = ", ".join(map(str, getattr(table, "columns", ())))
        raise ChannelError(f"{source}: no column {column!r}, expected one of {have}") from error


FAULT_KINDS: Mapping[str, str] = {
    "checksum_mismatch": "a checksum of the file does not fit: some value may be wrong",
    "cut_off": "the file breaks off, or a journal was left beside it",
    "damaged_chunks": "chunks left out: checksum, size or compression do not fit, or they break off",
    "damaged_file": "a file of the bag left out: it cannot be read at all",
    "unnamed_file": "a file beside those that metadata.yaml names, left out",
    "damaged_messages": "messages left out: they do not fit their type, or nothing declares them",
    "damaged_metadata": "metadata.yaml is not understood, its counts are not compared",
    "damaged_records": "stretches of the file that are not records",
    "data_after_end": "records after the end of the data; they are used",
    "empty_fields": "a field is empty in some of the messages",
    "missing_messages": "fewer messages than the file's statistics or metadata.yaml say",
    "surplus_messages": "more messages than the file's statistics or metadata.yaml say",
    "unknown_records": "records of a kind that the format does not define, left out",
    "zero_stamps": "header stamps that are zero; the log time replaces them",
    "missing_values": "cells of a table that are empty or not a number, left out",
    "rows_left_out": "rows of a table with another number of cells, left out",
    "raw_codes": "a column of a table holds codes of a device, not numbers; its channel is left out",
    "coarse_stamps": "stamps of a clock coarser than the samples, which are dated evenly between them",
    "rounded_stamps": "stamps rounded to a step of which the sample period is no multiple",
    "clock_jump": "the clock of the stamps jumped; the jump is removed",
    "clock_offset": "the clock of a channel differs from the command's",
    "clock_drift": "the clock of a channel runs faster or slower than the command's",
    "early_torque": "each motor torque has the stamp of its command; it is read just after that stamp",
    "dropped_samples": "samples are missing: the stamps have gaps",
    "pause": "nothing was recorded for a while, of any channel",
    "mixed_rows": "the clock stepped back and the log was sorted by it: rows of two times, left out",
    "partly_recorded": "a channel starts later or ends earlier than the run",
    "duplicate_stamps": "stamps repeat; the first sample of each is kept",
    "out_of_order": "samples out of order in the log, sorted by their stamps",
    "stray_stamps": "samples left out because their stamps are wrong",
    "commands_left_out": "commands that the excitation did not send in time",
    "device_fault": "the driver latched a fault: the torque was zero until it was cleared",
    "late_commands": "commands that did not act at their stamps",
    "limited_commands": "commands that the driver reduced to its limits",
    "lost_cycles": "cycles of the bench that did not run, or that the device did not answer",
    "lost_messages": "messages that the middleware lost before the recorder",
    "refused_commands": "commands that the bench refused",
    "watchdog_trips": "the torque went to zero because no command came in time",
    "clipping": "samples at the limit of the sensor's range",
    "dead_channel": "a sensor that does not respond to the machine; no result uses it",
    "sign": "a channel has the opposite sign to the rig",
    "scale": "a channel has another unit than the rig",
    "offset": "a zero is off: of the F/T torque beyond any of the run, of the position beyond its motion",
    "angle_jumps": "an angle jumps: it is wrapped at a turn, or the encoder began to count anew",
    "no_excitation": "the command never changes: the data show nothing of the machine",
    "standstill": "the machine stands still for a while although the command goes on",
    "smoothing": "a channel was averaged before it was logged",
    "wrong_rig": "the record does not fit the rig",
    "coarse_steps": "values in much larger steps than those of the rig's sensor",
    "held_samples": "the log repeats the values of a slow sensor; the repeats are left out",
    "interpolated": "the log was resampled on straight lines; the samples between their ends are left out",
    "frozen_samples": "samples that repeat while the machine moves",
    "missing_topic": "a channel of the rig's sensors is missing",
    "nan": "values that are not a number",
    "outliers": "samples far from their neighbours",
}
"""Kinds of faults of the data: of the file, of the stamps, of the run (/diagnostics), of the values."""

MASKED = frozenset({"nan", "outliers", "clipping", "frozen_samples"})
"""Kinds of faults whose samples stay in the record and are masked."""
