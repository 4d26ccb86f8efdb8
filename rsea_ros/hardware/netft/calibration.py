"""Calibration of the sensor, from its web page."""

import io
import math
import re
import socket
import time
from collections.abc import Mapping
from dataclasses import dataclass
from http.client import HTTPException, HTTPResponse
from typing import Any, cast
from xml.parsers import expat

from rsea_ros.documents.strict_yaml import is_decimal
from rsea_ros.documents.wording import quote
from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import Wrench

LARGEST = 1 << 20
"""Bytes. The calibration of an F/T sensor has 4 kB."""


def get(host: str, port: int, path: str, limit: float) -> bytes:
    """Return the answer of a device to GET within a limit in s. Raises DeviceError."""
    address = f"http://{host}:{port}{path}"
    deadline = time.monotonic() + limit
    try:
        with socket.create_connection((host, port), timeout=limit) as connection:
            request = f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n"
            connection.sendall(request.encode("ascii"))
            return _answer(connection, deadline)
    except TimeoutError:
        raise DeviceError(f"F/T sensor {address}: no whole answer within {limit:g} s") from None
    except (OSError, HTTPException, ValueError) as error:
        reason = quote(str(error) or type(error).__name__, 120)[1:-1]
        raise DeviceError(f"F/T sensor {address}: {reason}, expected its calibration") from None


def _answer(connection: socket.socket, deadline: float) -> bytes:
    """Return the body of a response. Raises OSError, HTTPException, ValueError."""
    response = HTTPResponse(cast("socket.socket", _Source(connection, deadline)))
    response.begin()
    if response.status != 200:
        raise ValueError(f"status {response.status} {response.reason}")
    body = response.read(LARGEST + 1)
    if len(body) > LARGEST:
        raise ValueError(f"more than {LARGEST} bytes")
    if response.length:
        raise ValueError(f"{response.length} bytes are missing at its end")
    return body


class _Source(io.RawIOBase):
    """Bytes of a connection until a deadline; every wait is limited to the remaining time."""

    def __init__(self, connection: socket.socket, deadline: float) -> None:
        self._connection = connection
        self._deadline = deadline

    def makefile(self, mode: str) -> io.BufferedReader:
        """Return a file for HTTPResponse."""
        return io.BufferedReader(self)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        left = self._deadline - time.monotonic()
        if left <= 0.0:
            raise TimeoutError
        self._connection.settimeout(left)
        return self._connection.recv_into(buffer)


NEWTON = {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605, "klbf": 4448.2216152605, "kgf": 9.80665}
"""N per unit of force, as the sensor names it (`scfgfu`)."""
NEWTON_METRE = {
    "N-m": 1.0, "Nm": 1.0, "N-mm": 1e-3, "Nmm": 1e-3, "kN-m": 1e3, "kNm": 1e3, "lbf-in": 0.1129848290276167,
    "lbf-ft": 1.3558179483314004, "kgf-cm": 0.0980665, "kgfcm": 0.0980665,
}  # fmt: skip
"""N m per unit of torque (`scfgtu`)."""

_MOST = 1e12
"""Counts for a unit, or records a second. A sensor has a million counts for a newton."""


@dataclass(frozen=True)
class Calibration:
    """The value of a count: N and N m.

    rate: records a second that the sensor sends, Hz; nan if not stated. range: of each axis; inf likewise.
    low_pass: the number of its low pass (`setuserfilter`), 0 for none; empty likewise.
    """

    force: float
    torque: float
    rate: float = math.nan
    range: Wrench = (math.inf,) * 6
    low_pass: str = ""

    def wrench(self, counts: tuple[int, ...]) -> Wrench:
        """Return force x, y, z (N) and torque x, y, z (N m) of six counts."""
        fx, fy, fz, tx, ty, tz = counts
        f, t = self.force, self.torque
        return fx * f, fy * f, fz * f, tx * t, ty * t, tz * t


def parse(page: bytes, where: str = "netftapi2.xml") -> Calibration:
    """Return the calibration of a page. Raises DeviceError naming the field that is missing or wrong."""
    try:
        fields = _fields(page)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise DeviceError(f"{where}: not XML ({error}), expected the sensor's calibration") from None
    units = _unit(fields, "scfgfu", NEWTON, where), _unit(fields, "scfgtu", NEWTON_METRE, where)
    force, torque = units[0] / _counts(fields, "cfgcpf", where), units[1] / _counts(fields, "cfgcpt", where)
    rate = _counts(fields, "comrdtrate", where) if "comrdtrate" in fields else math.nan
    low_pass = fields.get("setuserfilter", "")
    known = low_pass if re.fullmatch(r"[0-9]{1,3}", low_pass) else ""
    return Calibration(force, torque, rate, _range(fields.get("cfgmr", ""), *units), known)


def _range(text: str, newton: float, newton_metre: float) -> Wrench:
    """Return the calibrated range of the axes (`cfgmr`, six numbers in the page's units); inf without one."""
    parts = re.split(r"[;,\s]+", text)
    if len(parts) != 6 or not all(is_decimal(part) and float(part) > 0.0 for part in parts):
        return (math.inf,) * 6
    fx, fy, fz, tx, ty, tz = map(float, parts)
    f, t = newton, newton_metre
    return fx * f, fy * f, fz * f, tx * t, ty * t, tz * t


def fetch(host: str, port: int = 80, timeout: float = 2.0) -> Calibration:
    """Request the calibration of a sensor. Raises DeviceError without an answer within timeout, s."""
    return parse(get(host, port, "/netftapi2.xml", timeout), f"http://{host}:{port}/netftapi2.xml")


def _fields(page: bytes) -> Mapping[str, str]:
    """Return the text of every element by its name. Raises ValueError for a page that declares entities."""
    fields: dict[str, str] = {}
    path: list[str] = []

    def start(name: str, attributes: object) -> None:
        path.append(name)
        fields[name] = ""

    def text(data: str) -> None:
        if path:
            fields[path[-1]] += data

    def entity(name: str, *rest: object) -> None:
        raise ValueError(f"entity {quote(name)} declared")

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda name: path.pop()
    parser.CharacterDataHandler = text
    parser.EntityDeclHandler = entity
    parser.Parse(page, True)
    return {name: value.strip() for name, value in fields.items()}


def _counts(fields: Mapping[str, str], name: str, where: str) -> float:
    text = fields.get(name, "")
    value = float(text) if is_decimal(text) else 0.0
    if not 1.0 / _MOST < value < _MOST:
        raise DeviceError(f"{where}: {name} = {quote(text)}, expected a number above 0 and below {_MOST:g}")
    return value


def _unit(fields: Mapping[str, str], name: str, units: dict[str, float], where: str) -> float:
    text = fields.get(name, "")
    if text not in units:
        raise DeviceError(f"{where}: {name} = {quote(text)}, expected one of {', '.join(units)}")
    return units[text]
