"""The sensor's calibration, from `http://HOST/netftapi2.xml`: counts per unit, and which units."""

from __future__ import annotations

import math
import urllib.request
from dataclasses import dataclass
from http.client import HTTPException
from xml.etree import ElementTree

from rsea_ros.errors import DeviceError
from rsea_ros.hardware.device import Wrench

NEWTON = {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605, "klbf": 4448.2216152605, "kgf": 9.80665}
"""N per unit of force, as the sensor names it (`scfgfu`)."""
NEWTON_METRE = {
    "N-m": 1.0, "Nm": 1.0, "N-mm": 1e-3, "Nmm": 1e-3, "kN-m": 1e3, "kNm": 1e3, "lbf-in": 0.1129848290276167,
    "lbf-ft": 1.3558179483314004, "kgf-cm": 0.0980665, "kgfcm": 0.0980665,
}  # fmt: skip
"""N m per unit of torque (`scfgtu`)."""


@dataclass(frozen=True)
class Calibration:
    """What a count is worth: N and N m. rate: records a second that the sensor sends, Hz; nan if untold."""

    force: float
    torque: float
    rate: float = math.nan

    def wrench(self, counts: tuple[int, ...]) -> Wrench:
        """Return force x, y, z (N) and torque x, y, z (N m) of six counts."""
        fx, fy, fz, tx, ty, tz = counts
        f, t = self.force, self.torque
        return fx * f, fy * f, fz * f, tx * t, ty * t, tz * t


def parse(page: bytes, where: str = "netftapi2.xml") -> Calibration:
    """Return the calibration of a page. Raises DeviceError naming the field that is missing or wrong."""
    try:
        root = ElementTree.fromstring(page)
    except ElementTree.ParseError as error:
        raise DeviceError(f"{where}: not XML ({error}), expected the sensor's calibration") from None
    fields = {element.tag: (element.text or "").strip() for element in root.iter()}
    force = _unit(fields, "scfgfu", NEWTON, where) / _counts(fields, "cfgcpf", where)
    torque = _unit(fields, "scfgtu", NEWTON_METRE, where) / _counts(fields, "cfgcpt", where)
    rate = _counts(fields, "comrdtrate", where) if "comrdtrate" in fields else math.nan
    return Calibration(force, torque, rate)


def fetch(host: str, port: int = 80, timeout: float = 2.0) -> Calibration:
    """Ask a sensor for its calibration. Raises DeviceError when it does not answer."""
    address = f"http://{host}:{port}/netftapi2.xml"
    try:
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # the sensor is next door
        with opener.open(address, timeout=timeout) as answer:
            page = answer.read(1 << 20)
    except (OSError, HTTPException, ValueError) as error:
        raise DeviceError(f"F/T sensor {address}: {error}, expected its calibration") from None
    return parse(page, address)


def _counts(fields: dict[str, str], name: str, where: str) -> float:
    text = fields.get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not (math.isfinite(value) and value > 0.0):
        raise DeviceError(f"{where}: {name} = {text!r}, expected a number above 0")
    return value


def _unit(fields: dict[str, str], name: str, units: dict[str, float], where: str) -> float:
    text = fields.get(name, "")
    if text not in units:
        raise DeviceError(f"{where}: {name} = {text!r}, expected one of {', '.join(units)}")
    return units[text]
