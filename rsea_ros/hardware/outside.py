"""Devices from outside the package, as RSEA_EFFECTS adds effects: files that RSEA_DEVICES names."""

import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from rsea_ros.documents.wording import quote
from rsea_ros.errors import ParameterError
from rsea_ros.hardware.device import Device
from rsea_ros.plugins import plugin_constant, plugin_files

EXTRA_PATH = "RSEA_DEVICES"
"""Environment variable: files or folders of them, separated like PATH, each file with a DEVICE."""


@dataclass(frozen=True)
class DeviceKind:
    """The constant DEVICE of a file.

    name: value of the driver's parameter `device`. make: returns the device, not open, of the driver's
    parameters by name; `device_options` among them is a mapping of texts by name.
    feels: whether its readings have a wrench or the spring's deflection, so that ft_limit and
    deflection_limit can be applied.
    """

    name: str
    make: Callable[[Mapping[str, Any]], Device]
    feels: bool = False


def outside_device(name: str, known: Collection[str]) -> DeviceKind:
    """Return the kind of a name; known: those of the package, which cannot be replaced.

    Raises ParameterError for a name that nobody has, and for a file that does not fit.
    """
    files = plugin_files(os.environ.get(EXTRA_PATH, ""))
    kinds = [plugin_constant(EXTRA_PATH, str(path), "DEVICE", DeviceKind) for path in files]
    names = [*known, *(kind.name for kind in kinds)]
    if twice := sorted({each for each in names if names.count(each) > 1}):
        raise ParameterError(f"{EXTRA_PATH}: device {', '.join(map(quote, twice))} twice, expected once")
    for kind in kinds:
        if kind.name == name:
            return kind
    raise ParameterError(f"parameter device = {quote(name)}, expected one of {', '.join(names)}")


def options_of(text: str) -> dict[str, str]:
    """Return the options of `NAME=VALUE,…`. Raises ParameterError for a text of another form."""
    options = {}
    for part in filter(None, text.split(",")):
        name, is_one, value = part.partition("=")
        if not is_one or not name.strip():
            raise ParameterError(f"parameter device_options = {quote(text)}, expected NAME=VALUE,…")
        options[name.strip()] = value.strip()
    return options
