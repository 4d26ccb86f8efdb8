"""The root of every error that the package raises on purpose.

A message says what, value, unit, limit and where. The command line prints it as one line and exits
with status 2; a node turns it into a log line and a diagnostic.
"""

import math
from numbers import Real
from typing import Any


class RseaError(Exception):
    """Root of all errors of this package."""


class BagError(RseaError, ValueError):
    """A bag that cannot be read or written as requested."""


class ChannelError(RseaError, KeyError):
    """A channel that a record does not have, or that cannot be used."""

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class FieldError(RseaError, ValueError):
    """A value of a document that differs from the expected one.

    field: its place, such as `effects[0].name`; empty where no single field is wrong.
    """

    def __init__(self, message: str, field: str = "") -> None:
        super().__init__(message)
        self.field = field


class RigError(FieldError):
    """A rig file with a missing, unknown or impossible value."""


class ParameterError(RseaError, ValueError):
    """A parameter outside its range or of the wrong type."""


class ImportMapError(FieldError):
    """An import map that does not fit its data file."""


class IdentificationError(RseaError, ValueError):
    """Data that cannot give the requested parameters."""


class BenchmarkError(RseaError, ValueError):
    """A data set, a truth or answers of the cause-naming benchmark that are not as its rules say."""


class OutputError(RseaError, OSError):
    """A file that cannot be written: its name is taken, or it is an input."""


class DeviceError(RseaError, OSError):
    """A device that does not answer, or answers with a fault."""


def check_kind(name: str, value: object, kind: type | tuple[type, ...], expected: str) -> None:
    """Raise ParameterError for an argument of the wrong type; a door asks before it works."""
    if not isinstance(value, kind):
        raise ParameterError(f"{name}: {type(value).__name__}, expected {expected}")


def check_number(name: str, value: object) -> None:
    """Raise ParameterError for an argument that is no number."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ParameterError(f"{name}: {type(value).__name__}, expected a number")


def check_rate(rate: Any) -> None:
    """Raise ParameterError for what is no rate, Hz."""
    check_number("rate", rate)
    if not (math.isfinite(rate) and rate > 0.0):
        raise ParameterError(f"rate = {rate:g} Hz, expected a finite rate > 0")
