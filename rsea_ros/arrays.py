"""Records from arrays and tables that a program holds in memory."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from rsea_ros.errors import ChannelError
from rsea_ros.signals import UNITS, Channel, FloatArray, Record
from rsea_ros.units import plain

ALIASES: Mapping[str, str] = MappingProxyType(
    {
        "u": "command",
        "torque_command": "command",
        "tau_m": "motor_torque",
        "q": "position",
        "dq": "velocity",
        "qd": "velocity",
        "tau": "ft",
        "tau_d": "ft",
        "torque": "ft",
        "q_ref": "reference",
        "target_position": "reference",
        "q_spring": "deflection",
    }
)
"""Other names that people give to the channels of signals.UNITS."""

FEWEST = 2
"""Samples of a channel: fewer have no rate."""

_NO_NUMBERS = "cbmMSUV"
"""Kinds of numpy arrays that numpy would turn into numbers that nobody meant."""


class NamedColumns(Protocol):
    """A table with named columns, such as a pandas or Polars DataFrame."""

    def __getitem__(self, name: str, /) -> Any: ...


def record_from_arrays(t: npt.ArrayLike, source: str, channels: Mapping[str, npt.ArrayLike]) -> Record:
    """Return a record of channels that share their stamps t (s, shape (n,)); values are copied.

    channels: by a name of signals.UNITS or one of ALIASES, each in SI and of shape (n,).
    Raises ChannelError for an unknown name, another shape, complex numbers, texts or dates, stamps that are
    not finite or do not rise, a command that is not finite, or fewer than 2 samples.
    """
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
    _check_stamps(stamps, source)
    if "command" in values:
        _check_finite("command", UNITS["command"], values["command"], source)
    return Record({name: Channel(stamps - stamps[0], y) for name, y in values.items()}, source)


def record_from_table(table: NamedColumns, columns: Mapping[str, str], time: str, source: str) -> Record:
    """Return a record of named columns. columns: column by channel; time: the column of the stamps, s.

    Raises ChannelError for a column that the table lacks, and as record_from_arrays does.
    """
    series = {name: _column(table, column, source) for name, column in {"t": time, **columns}.items()}
    return record_from_arrays(series.pop("t"), source, series)


def _channel(name: str, source: str) -> str:
    channel = ALIASES.get(name, name)
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
    filled: FloatArray = numbers.filled(np.nan)
    return filled


def _check_finite(name: str, unit: str, values: FloatArray, source: str) -> None:
    for k in np.flatnonzero(~np.isfinite(values))[:1]:
        raise ChannelError(f"{source}: {name}[{k}] = {values[k]}, expected a finite value in {plain(unit)}")


def _check_stamps(stamps: FloatArray, source: str) -> None:
    wrong = np.flatnonzero(~(np.diff(stamps) > 0.0))
    if len(wrong):
        k = int(wrong[0]) + 1
        raise ChannelError(
            f"{source}: t[{k}] = {stamps[k]:g} s after {stamps[k - 1]:g} s, expected stamps that rise"
        )


def _column(table: NamedColumns, column: str, source: str) -> Any:
    try:
        return table[column]
    except (KeyError, IndexError, ValueError) as error:
        have = ", ".join(map(str, getattr(table, "columns", ())))
        raise ChannelError(f"{source}: no column {column!r}, expected one of {have}") from error
